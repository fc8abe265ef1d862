#include <benchmark/benchmark.h>

#include "core/traversability/occupancy_grid.hpp"
#include "core/traversability/traversability_map.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

RobotProfile car() {
  RobotProfile robot;
  robot.name = "car";
  robot.length_m = 4.5;
  robot.width_m = 1.9;
  robot.height_m = 2.2;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::road)) = 0.0;
  return robot;
}

/// A street of 120 m; 20 m tiles of 0.2 m cells.
const MapSnapshot& street() {
  static const MapSnapshot map = *test::street_map(120).view();
  return map;
}

/// Update after a change in one tile, including the tiles that it influences.
void update_one_tile(benchmark::State& state) {
  MapSnapshot map = street();
  TraversabilityMap traversability({car()});
  (void)traversability.update(map);
  const auto changed = map.tiles[map.tiles.size() / 2];
  Tile without = *changed;
  without.voxels = without.voxels.first(without.voxels.size() / 2);
  const std::array<Tile, 2> states{*changed, without};
  std::uint64_t round = 0;
  for (auto _ : state) {
    Tile tile = states.at(++round % 2);
    tile.info.revision = map.version + round;
    map.tiles.set(std::make_shared<const Tile>(std::move(tile)));
    benchmark::DoNotOptimize(traversability.update(map));
  }
}
BENCHMARK(update_one_tile)->Unit(benchmark::kMillisecond);

/// First update of a whole map; the counter is the number of tiles.
void update_whole_street(benchmark::State& state) {
  for (auto _ : state) {
    TraversabilityMap traversability({car()});
    benchmark::DoNotOptimize(traversability.update(street()));
  }
  state.counters["tiles"] = static_cast<double>(street().tiles.size());
}
BENCHMARK(update_whole_street)->Unit(benchmark::kMillisecond);

void whole_grid(benchmark::State& state) {
  TraversabilityMap traversability({car()});
  (void)traversability.update(street());
  for (auto _ : state) {
    benchmark::DoNotOptimize(occupancy_grid(*traversability.view("car"), whole_map_region()));
  }
}
BENCHMARK(whole_grid)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stillmap
