// The basin of registration: how often, and how fast, a scan finds its place when the lidar is not
// where its velocity says. Prints a table for each weighting; see --help.
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/terminal/command_line.hpp"
#include "config/loaders/sensor_file.hpp"
#include "core/lidar/angle_units.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/bench/bench_program.hpp"

namespace stillmap::bench {
namespace {

/// A registration has succeeded within these.
constexpr double max_error_m = 0.1;
constexpr double max_error_deg = 0.5;
/// Scans that are mapped before the one that is off: odometry judges no scan by fewer fits.
constexpr int scans_before = 10;

struct BasinArguments {
  int trials = 8;
  std::vector<double> errors_m{0.0, 0.5, 1.0, 2.0, 3.0};
  std::vector<double> errors_deg{0.0, 5.0, 10.0, 15.0};
  std::vector<std::string> cities{"quiet", "crowd"};
  std::string sensor = "hdl_64e";
};

struct Method {
  std::string name;
  OdometryConfig config;
};

std::vector<Method> methods() {
  std::vector<Method> all;
  for (const auto& [name, weighting] : {std::pair{"none", Weighting::none},
                                        {"geometric", Weighting::geometric},
                                        {"semantic", Weighting::semantic}}) {
    all.push_back({name, {}});
    all.back().config.weighting = weighting;
  }
  all.push_back({"eq. 10 alone", {}});
  all.back().config.paper_exact = true;
  return all;
}

/// A few scans of a drive.
struct Scene {
  SensorModel sensor;
  std::vector<simulation::SimulatedScan> scans;
};

std::vector<Scene> scenes(const BasinArguments& arguments) {
  std::vector<Scene> all;
  for (int trial = 0; trial < arguments.trials; ++trial) {
    simulation::SimulationConfig config;
    const auto cities = static_cast<int>(arguments.cities.size());
    config.plan = simulation::city_plan(arguments.cities[static_cast<std::size_t>(trial % cities)]);
    config.seed = static_cast<std::uint64_t>(100 + trial);
    config.sensor = load_sensor(arguments.sensor);
    config.scans = 100;
    const simulation::Simulation simulation(config);
    Scene scene{config.sensor, {}};
    // Under way, where the lidar drives.
    for (int k = 0; k <= scans_before; ++k) scene.scans.push_back(simulation.scan(50 + k));
    all.push_back(std::move(scene));
  }
  return all;
}

/// A motion of this size, level, in a direction of its own for each trial.
Eigen::Isometry3d displacement(double error_m, double error_deg, std::size_t trial) {
  std::mt19937 random(static_cast<std::uint32_t>(trial));
  const double bearing =
      std::uniform_real_distribution<double>(0.0, 2.0 * std::numbers::pi)(random);
  const double yaw = (random() % 2 == 0 ? 1.0 : -1.0) * error_deg * rad_per_deg;
  return Eigen::Translation3d(error_m * std::cos(bearing), error_m * std::sin(bearing), 0.0) *
         Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
}

struct TrialResult {
  bool success = false;
  bool wrong_called_good = false;
  double duration_ms = 0.0;
};

/// Maps the scene up to its last scan, which is then taken by a lidar that has moved by
/// `T_expected_lidar` beyond what its velocity says. It sees the same points: what would be hidden
/// or new a few metres on is not simulated.
TrialResult run_trial(const Scene& scene, const OdometryConfig& odometry,
                      const Eigen::Isometry3d& T_expected_lidar) {
  using Clock = std::chrono::steady_clock;
  TrialResult trial;
  Clock::time_point stage_began;
  MapperConfig config;
  config.sensor = scene.sensor;
  config.odometry = odometry;
  const auto stage_ended = [&](std::string_view stage) {
    const auto now = Clock::now();
    if (stage == "odometry")
      trial.duration_ms = std::chrono::duration<double, std::milli>(now - stage_began).count();
    stage_began = now;
  };
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>(),
                {.stage_ended = stage_ended, .pose_found = {}});
  for (int k = 0; k < scans_before; ++k)
    (void)mapper.process(scene.scans[static_cast<std::size_t>(k)].scan);
  Scan scan = scene.scans.back().scan;
  const Eigen::Isometry3f T_lidar_expected = T_expected_lidar.inverse().cast<float>();
  for (Eigen::Vector3f& point : scan.points_lidar) point = T_lidar_expected * point;
  const auto mapped = mapper.process(std::move(scan));
  if (!mapped) return trial;
  const Eigen::Isometry3d T_map_lidar_true =
      scene.scans.front().T_map_lidar.inverse() * scene.scans.back().T_map_lidar * T_expected_lidar;
  const Eigen::Isometry3d error = T_map_lidar_true.inverse() * mapped->odometry.T_map_lidar;
  const double error_deg = Eigen::AngleAxisd(error.linear()).angle() / rad_per_deg;
  const bool right = error.translation().norm() <= max_error_m && error_deg <= max_error_deg;
  trial.success = right && mapped->odometry.health != OdometryHealth::lost;
  trial.wrong_called_good = !right && mapped->odometry.health == OdometryHealth::good;
  return trial;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// One cell of the table; returns wrong poses called good.
int print_cell(const std::vector<Scene>& all, const OdometryConfig& odometry, double error_m,
               double error_deg) {
  std::size_t successes = 0;
  int wrong_called_good = 0;
  std::vector<double> durations_ms;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const TrialResult trial = run_trial(all[k], odometry, displacement(error_m, error_deg, k));
    successes += trial.success ? 1 : 0;
    wrong_called_good += trial.wrong_called_good ? 1 : 0;
    durations_ms.push_back(trial.duration_ms);
  }
  std::printf(" %zu/%zu, %.0f ms |", successes, all.size(), median(durations_ms));
  std::fflush(stdout);
  return wrong_called_good;
}

void print_table(const BasinArguments& arguments) {
  const std::vector<Scene> all = scenes(arguments);
  std::printf("| weighting | off by |");
  for (const double error_deg : arguments.errors_deg) std::printf(" %.0f deg |", error_deg);
  std::printf(" wrong, called good |\n|---|---|");
  for (std::size_t k = 0; k <= arguments.errors_deg.size(); ++k) std::printf("---|");
  std::printf("\n");
  for (const Method& method : methods()) {
    for (const double error_m : arguments.errors_m) {
      std::printf("| %s | %.1f m |", method.name.c_str(), error_m);
      int wrong_called_good = 0;
      for (const double error_deg : arguments.errors_deg)
        wrong_called_good += print_cell(all, method.config, error_m, error_deg);
      std::printf(" %d |\n", wrong_called_good);
    }
  }
}

int run(int argc, char** argv) {
  BasinArguments arguments;
  cli::CommandLine line("registration_basin_bench", "",
                        "Success and median time of registration over errors of the start");
  cli::CommandHandle root = line.root();
  root.option("--trials", arguments.trials, "Drives for each cell of the table")
      .between(1, 1000)
      .with_default();
  root.option("--errors-m", arguments.errors_m, "Distances of the start from the truth")
      .comma_separated()
      .with_default();
  root.option("--errors-deg", arguments.errors_deg, "Turns of the start about the vertical")
      .comma_separated()
      .with_default();
  root.option("--cities", arguments.cities, "Simulated cities, in turn")
      .comma_separated()
      .with_default();
  root.option("--sensor", arguments.sensor, "hdl_64e, hdl_32e, vlp_16 or a sensor file")
      .with_default();
  root.explain(
      "Ten scans are mapped at the drive's own velocity; the next one is taken by a lidar that has "
      "moved further by the error, in a direction that differs between trials. Success: within 0.1 "
      "m and 0.5 deg of the truth, and not called lost.");
  return run_program(line, argc, argv, [&] { print_table(arguments); });
}

}  // namespace
}  // namespace stillmap::bench

int main(int argc, char** argv) { return stillmap::bench::run(argc, argv); }
