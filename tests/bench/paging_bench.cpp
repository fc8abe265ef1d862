// A drive through many times the map that fits: memory, and what leaving and coming back costs.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <vector>

#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Clock = std::chrono::steady_clock;

double ms_of(const std::function<void()>& action) {
  const auto began = Clock::now();
  action();
  return std::chrono::duration<double, std::milli>(Clock::now() - began).count();
}

double process_mib() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0.0;
  statm >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

double mib(std::size_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// `range(0)` metres out along x and back, two metres a scan, a checkpoint every 5 s of a drive at
/// 10 m/s; `range(1)` MiB, 0 for no limit.
void drive_out_and_back(benchmark::State& state) {
  const int scans = static_cast<int>(state.range(0));
  const std::size_t limit = static_cast<std::size_t>(state.range(1)) << 20;
  std::vector<LabelledScan> seen;
  for (std::uint32_t seed = 0; seed < 8; ++seed) seen.push_back(test::street_scan(seed, 900));
  for (auto _ : state) {
    const auto store = open_scratch_map();
    StaticMap map{StaticMapConfig{}};
    map.reset(1);
    map.use_tile_store(store->tile_store());
    const double before_mib = process_mib();
    double peak_map_mib = 0.0, peak_process_mib = 0.0;
    std::vector<double> insert_ms, snapshot_ms, save_ms;
    for (int scan = 0; scan < scans; ++scan) {
      const double x = 2.0 * (scan < scans / 2 ? scan : scans - scan);
      LabelledScan& labelled = seen[static_cast<std::size_t>(scan) % seen.size()];
      labelled.scan.stamp_ns = scan + 1;
      const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(x, 0.0, 1.73));
      insert_ms.push_back(ms_of([&] { map.insert(labelled, T_map_lidar); }));
      if (limit > 0 && scan % 25 == 24) {
        MapCheckpoint checkpoint;
        snapshot_ms.push_back(ms_of([&] { checkpoint = map.checkpoint(); }));
        save_ms.push_back(ms_of([&] { store->save(to_saved_map(checkpoint)); }));
        map.checkpoint_stored(checkpoint.step);
        map.evict(T_map_lidar.translation(), limit);
      }
      peak_map_mib = std::max(peak_map_mib, scan % 25 == 24 ? mib(map.memory_use().bytes) : 0.0);
      peak_process_mib = std::max(peak_process_mib, process_mib() - before_mib);
    }
    const MemoryUse use = map.memory_use();
    state.counters["map_MiB"] = peak_map_mib;
    state.counters["process_MiB"] = peak_process_mib;
    state.counters["tiles"] = static_cast<double>(use.resident_tiles + use.non_resident_tiles);
    state.counters["away"] = static_cast<double>(use.non_resident_tiles);
    state.counters["insert_ms"] = median(insert_ms);
    state.counters["worst_insert_ms"] = std::ranges::max(insert_ms);
    state.counters["snapshot_ms"] = median(snapshot_ms);
    state.counters["save_ms"] = median(save_ms);
  }
}
BENCHMARK(drive_out_and_back)
    ->Args({3000, 0})
    ->Args({3000, 96})
    ->ArgNames({"scans", "limit_MiB"})
    ->Iterations(1)
    ->Unit(benchmark::kSecond);

}  // namespace
}  // namespace stillmap
