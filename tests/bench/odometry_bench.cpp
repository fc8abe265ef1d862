#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/mapper.hpp"
#include "core/odometry/features.hpp"
#include "core/odometry/registration.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap {
namespace {

/// A drive with an HDL-64E of some 120,000 points a scan, driven to and fro so that it never ends.
class Drive {
 public:
  explicit Drive(const std::string& plan) {
    simulation::SimulationConfig config;
    config.plan = simulation::city_plan(plan);
    config.scans = length;
    const simulation::Simulation simulation(config);
    for (int k = 0; k < length; ++k) scans_.push_back(simulation.scan(k));
  }

  /// The n-th scan, with a stamp of its own: there, back, and there again.
  [[nodiscard]] Scan scan(std::int64_t n) const {
    Scan scan = at(n).scan;
    scan.stamp_ns = n * 100'000'000;
    return scan;
  }
  [[nodiscard]] const simulation::SimulatedScan& at(std::int64_t n) const {
    const std::int64_t place = n % (2 * length - 2);
    return scans_[static_cast<std::size_t>(place < length ? place : 2 * length - 2 - place)];
  }

 private:
  static constexpr int length = 40;
  std::vector<simulation::SimulatedScan> scans_;
};

const Drive& drive(std::int64_t which) {
  static const Drive quiet("quiet");
  if (which == 0) return quiet;
  static const Drive crowd("crowd");
  return crowd;
}

void count_points(benchmark::State& state, const Drive& of) {
  state.SetLabel(state.range(0) == 0 ? "quiet" : "crowd");
  state.counters["points"] = static_cast<double>(of.at(0).scan.size());
}

PointLabels labels_of(const Scan& scan) { return PassthroughSegmenter().segment(scan); }

void extract_features_of_a_scan(benchmark::State& state) {
  const Drive& scans = drive(state.range(0));
  const Scan scan = scans.scan(0);
  for (auto _ : state) benchmark::DoNotOptimize(extract_features(scan, FeatureConfig{}));
  count_points(state, scans);
}

struct Registration {
  LocalMap map{LocalMapConfig{}};
  FeatureSets features;
  Eigen::Isometry3d T_map_lidar_predicted;

  /// A map of ten scans at their true poses, and the features of the eleventh, 0.3 m off.
  explicit Registration(const Drive& scans) {
    for (std::int64_t n = 0; n <= 10; ++n) {
      const Scan& scan = scans.at(n).scan;
      const Features found = extract_features(scan, FeatureConfig{});
      if (n < 10) {
        add(scan, found.edges, scans.at(n).T_map_lidar, map.edges);
        add(scan, found.planes, scans.at(n).T_map_lidar, map.planes);
        continue;
      }
      for (const auto i : found.edges)
        features.edges.push_back({scan.points_lidar[i], scan.labels[i]});
      for (const auto i : found.registered_planes)
        features.planes.push_back({scan.points_lidar[i], scan.labels[i]});
    }
    T_map_lidar_predicted = scans.at(10).T_map_lidar * Eigen::Translation3d(0.3, 0.0, 0.0);
  }

 private:
  static void add(const Scan& scan, const std::vector<std::uint32_t>& chosen,
                  const Eigen::Isometry3d& T_map_lidar, FeatureMap& map) {
    std::vector<LabelledPoint> points;
    const Eigen::Isometry3f T = T_map_lidar.cast<float>();
    for (const auto i : chosen) points.push_back({T * scan.points_lidar[i], scan.labels[i]});
    map.insert(points);
  }
};

void register_a_scan(benchmark::State& state) {
  const Drive& scans = drive(state.range(0));
  const Registration scene(scans);
  for (auto _ : state)
    benchmark::DoNotOptimize(register_features(scene.features, scene.map,
                                               scene.T_map_lidar_predicted, OdometryConfig{}));
  count_points(state, scans);
}

/// Odometry with map update, on a drive.
void odometry_add(benchmark::State& state) {
  const Drive& scans = drive(state.range(0));
  Odometry odometry(OdometryConfig{}, hdl_64e());
  std::int64_t n = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const Scan scan = scans.scan(n++);
    const PointLabels labels = labels_of(scan);
    state.ResumeTiming();
    const auto step = test::register_scan(odometry, scan, labels, std::nullopt);
    if (step.result.health == OdometryHealth::lost) state.SkipWithError("lost");
  }
  count_points(state, scans);
}

/// The whole pipeline with labels from the stream.
void mapper_process(benchmark::State& state) {
  const Drive& scans = drive(state.range(0));
  MapperConfig config;
  config.sensor = hdl_64e();
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
  std::int64_t n = 0;
  for (auto _ : state) {
    state.PauseTiming();
    Scan scan = scans.scan(n++);
    state.ResumeTiming();
    if (!mapper.process(std::move(scan))) state.SkipWithError("rejected");
  }
  count_points(state, scans);
}

BENCHMARK(extract_features_of_a_scan)
    ->DenseRange(0, 1)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(register_a_scan)->DenseRange(0, 1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(odometry_add)->DenseRange(0, 1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(mapper_process)->DenseRange(0, 1)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace stillmap
