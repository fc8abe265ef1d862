#include <benchmark/benchmark.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "core/map/query/map_query.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

/// The pose of the n-th scan of a drive along x, a metre a scan.
Eigen::Isometry3d T_map_lidar_at(std::int64_t n) {
  return Eigen::Isometry3d(Eigen::Translation3d(static_cast<double>(n), 0.0, 1.73));
}

/// A full scan of an HDL-64E, on a drive: half of its voxels are new.
void insert_scan(benchmark::State& state) {
  const LabelledScan scan = test::street_scan(1);
  StaticMap map{StaticMapConfig{}};
  std::int64_t n = 0;
  for (auto _ : state) map.insert(scan, T_map_lidar_at(n++));
  state.counters["points"] = static_cast<double>(scan.scan.size());
}
BENCHMARK(insert_scan)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

/// The view after each scan: every tile in range was touched.
void view_after_scan(benchmark::State& state) {
  const LabelledScan scan = test::street_scan(1);
  StaticMap map{StaticMapConfig{}};
  std::int64_t n = 0;
  for (auto _ : state) {
    state.PauseTiming();
    map.insert(scan, T_map_lidar_at(n++));
    state.ResumeTiming();
    benchmark::DoNotOptimize(map.view());
  }
}
BENCHMARK(view_after_scan)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0.0;
  statm >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

/// A drive of 400 full scans, its memory, and its last view.
struct Drive {
  Drive() {
    std::vector<LabelledScan> scans;
    for (std::uint32_t seed = 0; seed < 16; ++seed) scans.push_back(test::street_scan(seed));
    const double before = resident_bytes();
    for (int n = 0; n < 400; ++n) {
      LabelledScan& scan = scans[static_cast<std::size_t>(n) % scans.size()];
      scan.scan.stamp_ns = n * 100'000'000LL;
      // Not a whole number of voxels: every scan hits a voxel elsewhere.
      map.insert(scan, Eigen::Isometry3d(Eigen::Translation3d(0.937 * n, 0.0, 1.73)));
    }
    stored.view = *map.view();
    for (const auto& tile : stored.view.tiles) voxels += static_cast<double>(tile->voxels.size());
    memory_bytes = resident_bytes() - before;
  }
  StaticMap map{StaticMapConfig{}};
  SavedMap stored;
  double voxels = 0.0;
  double memory_bytes = 0.0;
};

const Drive& drive() {
  static const Drive drive;
  return drive;
}

/// All voxels in 50 m x 50 m around the middle of the drive, in one page.
void query_50_m(benchmark::State& state) {
  MapQuery query;
  query.region = BoxRegion{
      .box_map = Eigen::AlignedBox3d(Eigen::Vector3d(175, -25, -10), Eigen::Vector3d(225, 25, 10))};
  query.max_bytes = 100'000'000;
  query.resolution_m = static_cast<double>(state.range(0)) / 10.0;
  const MapSnapshot& view = drive().stored.view;
  MapQueryResult result;
  for (auto _ : state) result = query_map(view, query);
  state.counters["voxels"] = static_cast<double>(result.voxels.size());
  state.counters["map_voxels"] = drive().voxels;
  state.counters["memory_bytes_a_voxel"] = drive().memory_bytes / drive().voxels;
}
BENCHMARK(query_50_m)->ArgName("resolution_dm")->Arg(0)->Arg(5)->Unit(benchmark::kMillisecond);

/// The whole map into a new file.
void save_drive(benchmark::State& state) {
  const auto file = std::filesystem::temp_directory_path() / "map_bench.stillmap";
  (void)drive();
  for (auto _ : state) {
    std::filesystem::remove(file);
    open_map_file(file)->save(drive().stored);
  }
  state.counters["disk_bytes_a_voxel"] =
      static_cast<double>(std::filesystem::file_size(file)) / drive().voxels;
}
BENCHMARK(save_drive)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

/// Open, check and decode the file that save_drive left.
void load_drive(benchmark::State& state) {
  const auto file = std::filesystem::temp_directory_path() / "map_bench.stillmap";
  open_map_file(file)->save(drive().stored);
  for (auto _ : state) benchmark::DoNotOptimize(open_map_file(file)->load());
  std::filesystem::remove(file);
}
BENCHMARK(load_drive)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

}  // namespace
}  // namespace stillmap
