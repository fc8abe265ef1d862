#include <benchmark/benchmark.h>

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <ctime>
#include <mutex>

#include "core/map/storage/map_file.hpp"
#include "core/traversability/traversability_query.hpp"
#include "idl/conversions/occupancy_grid.hpp"
#include "server/traversability/traversability_grid.hpp"
#include "server/traversability/traversability_thread.hpp"

namespace stillmap {
namespace {

double thread_cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

/// Counts updates with their processor time and waits for the next.
class UpdateCount {
 public:
  /// Called by the updating thread.
  void add() {
    const double cpu_ms = thread_cpu_ms();
    const std::scoped_lock lock(mutex_);
    last_work_ms_ = cpu_ms - last_cpu_ms_;
    last_cpu_ms_ = cpu_ms;
    ++count_;
    changed_.notify_all();
  }
  /// Returns the processor time of the last update.
  double wait_for(std::uint64_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return count_ >= count; });
    return last_work_ms_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t count_ = 0;
  double last_cpu_ms_ = 0.0;
  double last_work_ms_ = 0.0;
};

/// The map file that STILLMAP_BENCH_MAP names; without it, nothing, and the reason in the state.
std::optional<MapSnapshot> bench_map(benchmark::State& state) {
  if (const char* const file = std::getenv("STILLMAP_BENCH_MAP")) {
    return open_map_file(file)->load().view;
  }
  state.SkipWithError("STILLMAP_BENCH_MAP must name a map file (stillmap map CITY --out FOLDER)");
  return std::nullopt;
}

void report(std::vector<double> ms, const std::string& name, benchmark::State& state) {
  if (ms.empty()) return;
  std::ranges::sort(ms);
  state.counters[name + "p50_ms"] = ms[ms.size() / 2];
  state.counters[name + "p99_ms"] = ms[ms.size() * 99 / 100];
}

/// A map of which one tile after the other changes: it loses every second voxel, and has all again
/// at its next change.
class ChangingMap {
 public:
  explicit ChangingMap(MapSnapshot map)
      : whole_(std::move(map)), now_(whole_), is_halved_(whole_.tiles.size(), false) {}

  std::shared_ptr<const MapSnapshot> change() {
    const std::size_t i = turn_++ * 7 % whole_.tiles.size();
    Tile tile = *whole_.tiles[i];
    is_halved_[i] = !is_halved_[i];
    std::size_t n = 0;
    if (is_halved_[i]) {
      std::vector<Voxel> voxels(tile.voxels.begin(), tile.voxels.end());
      std::erase_if(voxels, [&](const Voxel&) { return ++n % 2 == 0; });
      tile.voxels = PackedVoxels(tile.info.id, tile.voxels.grid(), voxels);
    }
    tile.info.revision = ++now_.version;
    now_.tiles.set(std::make_shared<const Tile>(std::move(tile)));
    return std::make_shared<const MapSnapshot>(now_);
  }

 private:
  MapSnapshot whole_;
  MapSnapshot now_;
  std::vector<bool> is_halved_;
  std::size_t turn_ = 0;
};

/// Time from a change of a tile in the server's latest map until the traversability of two robots
/// is published and the grid of the whole map is encoded; and the processor time of the thread,
/// which has a low priority.
void tile_change_to_published_traversability(benchmark::State& state) {
  const std::optional<MapSnapshot> map = bench_map(state);
  if (!map) return;
  const TraversabilityConfig config;
  server::LatestMap maps;
  TileReader tiles;
  server::TraversabilitySnapshot areas;
  server::Statistics statistics;
  UpdateCount updates;
  const server::TraversabilityGridProvider grid_provider(config, "map", maps, areas);
  maps.begin(std::make_shared<const MapSnapshot>(*map), {});
  const server::TraversabilityThread thread(
      load_robots(config), server::FollowedMap{.latest = maps, .tiles = tiles, .bytes_on_disk = 0},
      areas, statistics, server::TraversabilityUpdates{.updated = [&] {
        benchmark::DoNotOptimize(grid_provider.message(grid_provider.grid()));
        updates.add();
      }});
  updates.wait_for(1);
  std::vector<double> ms;
  std::vector<double> cpu_ms;
  ChangingMap changing(*map);
  for (auto _ : state) {
    const auto next = changing.change();
    const auto began = std::chrono::steady_clock::now();
    maps.publish(next);
    cpu_ms.push_back(updates.wait_for(2 + ms.size()));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
    state.SetIterationTime(took.count());
    ms.push_back(1000.0 * took.count());
  }
  report(ms, "", state);
  report(cpu_ms, "cpu_", state);
  state.counters["tiles"] = static_cast<double>(map->tiles.size());
}
BENCHMARK(tile_change_to_published_traversability)
    ->Unit(benchmark::kMillisecond)
    ->UseManualTime()
    ->Iterations(300);

/// Grid with reasons and outlines around the map's centre; args: metres across, and type of region
/// (0 box, 1 sphere).
void query_region(benchmark::State& state) {
  const std::optional<MapSnapshot> map = bench_map(state);
  if (!map) return;
  TraversabilityMap areas(load_robots(TraversabilityConfig{}));
  static_cast<void>(areas.update(*map));
  const TraversabilityView& view = *areas.view("car");
  const double radius_m = 0.5 * static_cast<double>(state.range(0));
  const Eigen::Vector2d centre = view.bounds_map().center();
  TraversabilityQuery query;
  query.include_outlines = true;
  BoxRegion box;
  box.box_map.min().head<2>() = centre - Eigen::Vector2d::Constant(radius_m);
  box.box_map.max().head<2>() = centre + Eigen::Vector2d::Constant(radius_m);
  query.region = box;
  if (state.range(1) == 1) {
    query.region = SphereRegion{.centre_map = {centre.x(), centre.y(), 0.0}, .radius_m = radius_m};
  }
  std::vector<double> cpu_ms;
  std::size_t cells = 0;
  for (auto _ : state) {
    const double began_ms = thread_cpu_ms();
    cells = query_traversability(view, query).cells.size();
    cpu_ms.push_back(thread_cpu_ms() - began_ms);
  }
  report(cpu_ms, "cpu_", state);
  state.counters["cells"] = static_cast<double>(cells);
}
BENCHMARK(query_region)
    ->ArgNames({"across_m", "region"})
    ->ArgsProduct({{20, 50, 200}, {0, 1}})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(200);

}  // namespace
}  // namespace stillmap
