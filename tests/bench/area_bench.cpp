#include <benchmark/benchmark.h>

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <mutex>

#include "core/map/map_file.hpp"
#include "idl/conversions/occupancy_grid.hpp"
#include "server/area_thread.hpp"
#include "server/planning_grid.hpp"

namespace stillmap {
namespace {

/// Counts updates, and lets others wait for the next.
class UpdateCount {
 public:
  void add() {
    const std::scoped_lock lock(mutex_);
    ++count_;
    changed_.notify_all();
  }
  void wait_for(std::uint64_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return count_ >= count; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t count_ = 0;
};

/// A map of which one tile after the other changes: it loses every second voxel, and has them all
/// again at its next turn.
class ChangingMap {
 public:
  explicit ChangingMap(MapView map)
      : whole_(std::move(map)), now_(whole_), is_thin_(whole_.tiles.size(), false) {}

  std::shared_ptr<const MapView> change() {
    const std::size_t i = turn_++ * 7 % whole_.tiles.size();
    Tile tile = *whole_.tiles[i];
    is_thin_[i] = !is_thin_[i];
    std::size_t n = 0;
    if (is_thin_[i]) std::erase_if(tile.voxels, [&](const Voxel&) { return ++n % 2 == 0; });
    tile.info.revision = ++now_.version;
    now_.tiles[i] = std::make_shared<const Tile>(std::move(tile));
    return std::make_shared<const MapView>(now_);
  }

 private:
  MapView whole_;
  MapView now_;
  std::vector<bool> is_thin_;
  std::size_t turn_ = 0;
};

/// A tile changes on the board of a server that keeps the areas of a car and a delivery robot,
/// until both are shown and the grid of the whole map is ready to be sent. The map file is named by
/// STILLMAP_BENCH_MAP.
void tile_change_to_published_area(benchmark::State& state) {
  const char* const file = std::getenv("STILLMAP_BENCH_MAP");
  if (file == nullptr) {
    state.SkipWithError("STILLMAP_BENCH_MAP must name a map file (stillmap map CITY --out FOLDER)");
    return;
  }
  const MapView map = open_map_file(file)->load().view;
  const AreasConfig config;
  MapBoard maps;
  AreaBoard areas;
  Statistics statistics;
  UpdateCount updates;
  const PlanningGrid planning_grid(config, "map", maps, areas);
  maps.begin(std::make_shared<const MapView>(map), {});
  const AreaThread thread(robots_of(config), std::chrono::seconds(0), maps, areas, statistics, [&] {
    benchmark::DoNotOptimize(planning_grid.message(planning_grid.grid()));
    updates.add();
  });
  updates.wait_for(1);
  std::vector<double> ms;
  ChangingMap changing(map);
  for (auto _ : state) {
    const auto next = changing.change();
    const auto began = std::chrono::steady_clock::now();
    maps.show(next);
    updates.wait_for(2 + ms.size());
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
    state.SetIterationTime(took.count());
    ms.push_back(1000.0 * took.count());
  }
  std::ranges::sort(ms);
  state.counters["p50_ms"] = ms[ms.size() / 2];
  state.counters["p99_ms"] = ms[ms.size() * 99 / 100];
  state.counters["tiles"] = static_cast<double>(map.tiles.size());
}
BENCHMARK(tile_change_to_published_area)
    ->Unit(benchmark::kMillisecond)
    ->UseManualTime()
    ->Iterations(300);

}  // namespace
}  // namespace stillmap
