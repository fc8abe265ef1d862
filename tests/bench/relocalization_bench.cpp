// Found again anywhere: places of another day, and of other cities, looked for in a map with no
// prior pose. Prints a table; see --help.
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/terminal/command_line.hpp"
#include "core/lidar/angle_units.hpp"
#include "core/lidar/prepare.hpp"
#include "core/localization/localizer.hpp"
#include "core/map/map_id.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/bench/bench_program.hpp"

namespace stillmap::bench {
namespace {

using Clock = std::chrono::steady_clock;
/// A place is right within these.
constexpr double max_error_m = 0.5;
constexpr double max_error_rad = 2.0 * rad_per_deg;

struct Arguments {
  std::string preset = "quiet";
  std::string sensor = "VLP-16";
  int scans = 300;
  int places = 20;
  std::vector<std::string> seeds{"1"};
  std::string folder = std::filesystem::temp_directory_path();
  bool without_labels = false;
  bool unlabelled_map = false;
  bool is_verbose = false;
};

SensorModel sensor_model(const std::string& name) {
  for (const SensorModel& sensor : {hdl_64e(), hdl_32e(), vlp_16()})
    if (sensor.name == name) return sensor;
  throw std::invalid_argument("no sensor '" + name + "': there are HDL-64E, HDL-32E and VLP-16");
}

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

simulation::SimulationConfig simulation_config(const Arguments& arguments, int seed) {
  simulation::SimulationConfig config;
  config.plan = simulation::city_plan(arguments.preset);
  config.seed = static_cast<std::uint64_t>(seed);
  config.sensor = sensor_model(arguments.sensor);
  config.scans = arguments.scans;
  return config;
}

/// The map of the first round, and where each of its scans truly was.
struct FirstRound {
  SavedMap map;
  /// In the city's frame.
  std::vector<Eigen::Isometry3d> T_city_lidar;

  /// Where a pose of the city should be in the map: its drift is none of localization's.
  [[nodiscard]] Eigen::Isometry3d expected(const Eigen::Isometry3d& T_city_query) const {
    std::size_t best = 0;
    const auto distance = [&](std::size_t k) {
      return (T_city_lidar[k].translation() - T_city_query.translation()).squaredNorm();
    };
    for (std::size_t k = 0; k < T_city_lidar.size(); ++k)
      if (distance(k) < distance(best)) best = k;
    return map.trajectory[best].T_map_lidar * T_city_lidar[best].inverse() * T_city_query;
  }
};

FirstRound first_round(const Arguments& arguments, int seed) {
  const simulation::SimulationConfig config = simulation_config(arguments, seed);
  const std::string name = arguments.preset + "_" + arguments.sensor + "_" + std::to_string(seed) +
                           "_" + std::to_string(arguments.scans) +
                           (arguments.unlabelled_map ? "_none" : "") + ".stillmap";
  const std::filesystem::path file = std::filesystem::path(arguments.folder) / name;
  const simulation::Simulation simulation(config);
  FirstRound round;
  for (int k = 0; k < config.scans; ++k)
    round.T_city_lidar.push_back(simulation.T_map_lidar_at(k * config.sensor.period_s));
  if (!std::filesystem::exists(file)) {
    MapperConfig mapper_config;
    mapper_config.sensor = config.sensor;
    Mapper mapper(mapper_config, std::make_unique<PassthroughSegmenter>());
    mapper.reset(new_map_id());
    for (int k = 0; k < config.scans; ++k) {
      Scan scan = simulation.scan(k).scan;
      if (arguments.unlabelled_map) scan.labels.clear();
      static_cast<void>(mapper.process(std::move(scan)));
    }
    SavedMap map = to_saved_map(mapper.static_map().checkpoint(CheckpointScope::everything));
    map.trajectory = mapper.trajectory();
    open_map_file(file)->save(map);
  }
  round.map = open_map_file(file)->load();
  return round;
}

/// Whether a scan was taken inside an oncoming vehicle, which drives through this lidar: its points
/// are of that, and show nothing of the place.
bool is_inside_vehicle(const Scan& scan) {
  constexpr float vehicle_m = 3.0F;
  const auto is_of_vehicle = [&](std::size_t i) {
    return is_movable(scan.labels[i]) && scan.points_lidar[i].norm() < vehicle_m;
  };
  std::size_t near = 0;
  for (std::size_t i = 0; i < scan.size(); ++i) near += is_of_vehicle(i) ? 1 : 0;
  return 2 * near > scan.size();
}

struct Tally {
  /// Taken inside a vehicle; none of the others is.
  int inside = 0;
  int right = 0;
  int wrong = 0;
  int ambiguous = 0;
  int not_found = 0;
  std::vector<double> times_ms;
};

struct Ride {
  double lateral_m = 0.0;
  double turned_deg = 0.0;
};

/// The places that were found beside the true one.
struct PlaceErrors {
  /// Of the first one; -1 where there is none.
  double first_m = -1.0;
  double first_deg = -1.0;
  /// The first one that is right, by its place in the list; -1: none is.
  int rank_of_right = -1;
};

PlaceErrors errors_of(const LocalizationResult& result, const Eigen::Isometry3d& T_map_lidar_true,
                      bool is_same_city) {
  PlaceErrors errors;
  for (std::size_t p = 0; p < result.places.size(); ++p) {
    const Eigen::Isometry3d off = T_map_lidar_true.inverse() * result.places[p].T_map_lidar;
    const double off_m = off.translation().norm();
    const double off_rad = Eigen::AngleAxisd(off.linear()).angle();
    if (p == 0) {
      errors.first_m = off_m;
      errors.first_deg = off_rad / rad_per_deg;
    }
    const bool is_right = is_same_city && off_m < max_error_m && off_rad < max_error_rad;
    if (is_right && errors.rank_of_right < 0) errors.rank_of_right = static_cast<int>(p);
  }
  return errors;
}

void count(LocalizationStatus status, const PlaceErrors& errors, Tally& tally) {
  switch (status) {
    case LocalizationStatus::found:
      ++(errors.rank_of_right == 0 ? tally.right : tally.wrong);
      break;
    case LocalizationStatus::ambiguous:
      ++tally.ambiguous;
      break;
    default:
      ++tally.not_found;
  }
}

void print_place(int scan, const LocalizationResult& result, const PlaceErrors& errors, double ms) {
  std::printf("  scan %4d %-10s rank %2d err %7.2f m %6.2f deg", scan, name(result.status),
              errors.rank_of_right, errors.first_m, errors.first_deg);
  for (std::size_t p = 0; p < std::min<std::size_t>(2, result.places.size()); ++p) {
    const PlaceHypothesis& h = result.places[p];
    std::printf(" | %.3f e %.2f c %.2f l %.2f s %.2f n %d/%d", h.evidence.score(),
                h.evidence.explained, h.evidence.confirmed, h.evidence.level, h.search_score,
                h.evidence.scan_points, h.evidence.map_points);
  }
  std::printf(" %.0f ms\n", ms);
}

Tally localize_places(const Arguments& arguments, const Localizer& localizer,
                      const FirstRound& round, const simulation::SimulationConfig& config,
                      bool is_same_city, const Ride& ride) {
  simulation::SimulationConfig shifted = config;
  shifted.T_base_lidar = Eigen::Translation3d(0.0, ride.lateral_m, config.lidar_height_m) *
                         Eigen::AngleAxisd(ride.turned_deg * rad_per_deg, Eigen::Vector3d::UnitZ());
  const simulation::Simulation simulation(shifted);
  Tally tally;
  for (int k = 0; k < arguments.places; ++k) {
    const int index = static_cast<int>((k + 0.5) * config.scans / arguments.places);
    const simulation::SimulatedScan simulated = simulation.scan(index);
    const Scan scan = drop_unusable_points(simulated.scan, PrepareConfig{});
    if (is_inside_vehicle(scan)) {
      ++tally.inside;
      continue;
    }
    PointLabels labels;
    if (!arguments.without_labels) labels.classes = scan.labels;
    const auto start = Clock::now();
    const LocalizationResult result = localizer.localize(scan, labels);
    tally.times_ms.push_back(milliseconds_since(start));
    const PlaceErrors errors =
        errors_of(result, round.expected(simulated.T_map_lidar), is_same_city);
    count(result.status, errors, tally);
    if (arguments.is_verbose) print_place(index, result, errors, tally.times_ms.back());
  }
  return tally;
}

void print(const std::string& what, Tally tally) {
  std::ranges::sort(tally.times_ms);
  const std::size_t count = tally.times_ms.size();
  const double median_ms = count == 0 ? 0.0 : tally.times_ms[count / 2];
  const double most_ms = count == 0 ? 0.0 : tally.times_ms.back();
  std::printf("| %-48s | %4d | %4d | %4d | %4d | %6d | %6.0f | %6.0f |\n", what.c_str(),
              tally.right, tally.wrong, tally.ambiguous, tally.not_found, tally.inside, median_ms,
              most_ms);
  std::fflush(stdout);
}

void print_table(const Arguments& arguments) {
  std::printf(
      "| places                                           | right| wrong| ambig| none | inside | "
      "ms med | ms max |\n");
  for (const std::string& seed_text : arguments.seeds) {
    const int seed = std::stoi(seed_text);
    const FirstRound round = first_round(arguments, seed);
    const auto start = Clock::now();
    const auto view = std::make_shared<const MapSnapshot>(round.map.view);
    const auto index = std::make_shared<const PlaceIndex>(view, round.map.trajectory,
                                                          std::make_shared<TileReader>());
    std::printf("seed %d: %zu voxels, %zu nodes, %zu blocks, index %.1f MB in %.0f ms\n", seed,
                view->tiles.voxel_count(), index->nodes().size(), index->blocks().size(),
                static_cast<double>(index->memory_bytes()) / 1e6, milliseconds_since(start));
    const Localizer localizer(index);
    simulation::SimulationConfig config = simulation_config(arguments, seed);
    config.day = 1;
    const std::string name =
        arguments.preset + " " + arguments.sensor + " seed " + std::to_string(seed);
    print(name + ", another day", localize_places(arguments, localizer, round, config, true, {}));
    print(name + ", day 2, 3.2 m left, turned 180",
          localize_places(arguments, localizer, round, config, true, {3.2, 180.0}));
    config.seed += 1000;
    print(name + ", another city", localize_places(arguments, localizer, round, config, false, {}));
  }
}

int run(int argc, char** argv) {
  Arguments arguments;
  cli::CommandLine line("relocalization_bench", "",
                        "Places of another day and of another city, looked for in a map");
  cli::CommandHandle root = line.root();
  root.option("--preset", arguments.preset, "City: quiet, crowd or yard").with_default();
  root.option("--sensor", arguments.sensor, "Sensor of both rounds").with_default();
  root.option("--scans", arguments.scans, "Scans of the first round").with_default();
  root.option("--places", arguments.places, "Places that are looked for").with_default();
  root.option("--seeds", arguments.seeds, "Cities").comma_separated().with_default();
  root.option("--folder", arguments.folder, "Where maps are kept").with_default();
  root.flag("--without-labels", arguments.without_labels, "Scans without labels");
  root.flag("--unlabelled-map", arguments.unlabelled_map, "A map made without labels");
  root.flag("--verbose", arguments.is_verbose, "A line for each place");
  return run_program(line, argc, argv, [&] { print_table(arguments); });
}

}  // namespace
}  // namespace stillmap::bench

int main(int argc, char** argv) { return stillmap::bench::run(argc, argv); }
