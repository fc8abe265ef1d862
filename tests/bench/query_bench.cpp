#include <benchmark/benchmark.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "core/map/query/map_query.hpp"
#include "core/map/static_map.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

/// A map of 2 km of street that goes on growing at 10 scans a second, as a server's mapper does it:
/// the newest view is handed over after every scan.
class GrowingMap {
 public:
  GrowingMap() {
    for (std::uint32_t seed = 0; seed < 8; ++seed) scans_.push_back(test::street_scan(seed, 900));
    while (scan_ < 2000) insert_next();
    view_ = map_.view();
    history_ = history_from(*view_);
    mapper_ = std::jthread([this](const std::stop_token& stop) { map(stop); });
  }

  [[nodiscard]] MapState state() {
    const std::scoped_lock lock(mutex_);
    return {view_, std::make_shared<const TileHistory>(history_)};
  }

 private:
  void insert_next() {
    const double x_m = 0.937 * static_cast<double>(scan_ < 2000 ? scan_ : 800 + scan_ % 400);
    map_.insert(scans_[scan_ % scans_.size()],
                Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.0, 1.73)));
    ++scan_;
  }

  void map(const std::stop_token& stop) {
    auto next = std::chrono::steady_clock::now();
    while (!stop.stop_requested()) {
      insert_next();
      auto view = map_.view();
      {
        const std::scoped_lock lock(mutex_);
        history_ = view_
                       ? history_with({view_, std::make_shared<const TileHistory>(history_)}, *view)
                       : history_from(*view);
        view_ = std::move(view);
      }
      next += std::chrono::milliseconds(100);
      std::this_thread::sleep_until(next);
    }
  }

  StaticMap map_{StaticMapConfig{}};
  std::vector<LabelledScan> scans_;
  std::size_t scan_ = 0;
  std::mutex mutex_;
  std::shared_ptr<const MapSnapshot> view_;
  TileHistory history_;
  std::jthread mapper_;
};

GrowingMap& growing_map() {
  static GrowingMap map;
  return map;
}

/// Where the mapper is at work, `size_m` across.
std::vector<Region> regions(double size_m) {
  const Eigen::Vector2d centre(937.0, 0.0);
  const double half_m = size_m / 2.0;
  BoxRegion box;
  box.box_map.min() = {centre.x() - half_m, -half_m, -10.0};
  box.box_map.max() = {centre.x() + half_m, half_m, 10.0};
  const auto corner = [&](double x, double y) {
    return Eigen::Vector2d(centre + half_m * Eigen::Vector2d(x, y));
  };
  return {box, SphereRegion{.centre_map = {centre.x(), 0.0, 0.0}, .radius_m = half_m},
          PolygonRegion{.corners_map = {corner(-1, -0.5), corner(0, -1), corner(1, -0.5),
                                        corner(0.6, 0), corner(1, 1), corner(-1, 0.7)},
                        .heights = {-10.0, 10.0}},
          CorridorRegion{.path_map = {corner(-1, -0.1), corner(0, 0.05), corner(1, 0)},
                         .half_width_m = 3.0,
                         .heights = {-10.0, 10.0}}};
}

/// All pages of a region's answer while the map changes; args: metres across, and which region
/// (0 box, 1 sphere, 2 polygon, 3 corridor).
void query_while_mapping(benchmark::State& state) {
  MapQuery query;
  query.region =
      regions(static_cast<double>(state.range(0))).at(static_cast<std::size_t>(state.range(1)));
  std::vector<double> ms;
  std::size_t voxels = 0;
  std::size_t map_voxels = 0;
  GrowingMap& growing = growing_map();  // made before the clock runs
  for (auto _ : state) {
    const auto began = std::chrono::steady_clock::now();
    const MapState map = growing.state();
    query.continuation.clear();
    voxels = 0;
    do {
      const MapQueryResult page = query_map(*map.view, query, map.history.get());
      voxels += page.voxels.size();
      query.continuation = page.continuation;
    } while (!query.continuation.empty());
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
    ms.push_back(took.count());
  }
  for (const auto& tile : growing.state().view->tiles) map_voxels += tile->voxels.size();
  std::ranges::sort(ms);
  state.counters["p50_ms"] = ms[ms.size() / 2];
  state.counters["p99_ms"] = ms[ms.size() * 99 / 100];
  state.counters["voxels"] = static_cast<double>(voxels);
  state.counters["map_voxels"] = static_cast<double>(map_voxels);
}
BENCHMARK(query_while_mapping)
    ->ArgNames({"across_m", "region"})
    ->ArgsProduct({{20, 50, 200}, {0, 1, 2, 3}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(300);

/// What changed in 200 m within the last ten versions.
void changes_while_mapping(benchmark::State& state) {
  MapQuery query;
  query.region = regions(200.0).front();
  query.max_bytes = 100'000'000;
  std::size_t tiles = 0;
  GrowingMap& growing = growing_map();
  for (auto _ : state) {
    const MapState map = growing.state();
    const std::uint64_t version = map.view->version;
    query.since = {map.view->map_id, std::max(map.history->known_since, version - 10)};
    tiles = query_map(*map.view, query, map.history.get()).tiles.size();
  }
  state.counters["tiles"] = static_cast<double>(tiles);
}
BENCHMARK(changes_while_mapping)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace stillmap
