#include "core/traversability/traversability_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <random>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::VoxelWorld;
using ::testing::HasSubstr;

RobotProfile tall_robot() {
  RobotProfile robot = square_robot();
  robot.name = "tall";
  robot.height_m = 3.0;
  robot.length_m = 2.4;
  robot.class_cost.at(static_cast<std::size_t>(sidewalk)) = 0.0;
  return robot;
}

void expect_same(const TraversabilityView& a, const TraversabilityView& b) {
  ASSERT_EQ(a.tiles.size(), b.tiles.size());
  EXPECT_EQ(a.version, b.version);
  for (std::size_t i = 0; i < a.tiles.size(); ++i) {
    EXPECT_EQ(a.tiles[i]->id, b.tiles[i]->id);
    EXPECT_TRUE(a.tiles[i]->cells == b.tiles[i]->cells) << "tile " << i;
    EXPECT_TRUE(*a.tiles[i]->surface == *b.tiles[i]->surface) << "tile " << i;
  }
}

/// One random change of a world of 36 m x 36 m.
void edit(VoxelWorld& world, std::mt19937& random) {
  std::uniform_real_distribution<double> place(-18.0, 17.0);
  std::uniform_real_distribution<double> size(0.2, 4.0);
  const double x = place(random);
  const double y = place(random);
  const double x1 = x + size(random);
  const double y1 = y + size(random);
  switch (random() % 5) {
    case 0:
      return world.clear(x, y, x1, y1);
    case 1:
      return world.block(x, y, x + 0.4, y + 0.4, 0.3, 2.5, pole);
    case 2:
      return world.ground(x, y, x1, y1, sidewalk, [](double, double) { return 0.25; });
    case 3:
      return world.ground(x, y, x1, y1, unlabeled);
    default:
      return world.ground(x, y, x1, y1, road);
  }
}

/// Tiles of so many cells a side: smaller than the reach of a change, and larger.
class TileSides : public ::testing::TestWithParam<int> {};

TEST_P(TileSides, IncrementalUpdatesEqualAFullOneBitByBit) {
  std::mt19937 random(11);
  VoxelWorld world(GetParam());
  world.ground(-18, -18, 18, 18, road);
  TraversabilityMap incremental({square_robot(), tall_robot()});
  (void)incremental.update(world.view());
  for (int round = 0; round < 15; ++round) {
    const int edits = 1 + static_cast<int>(random() % 3);
    for (int i = 0; i < edits; ++i) edit(world, random);
    const MapSnapshot map = world.view();
    (void)incremental.update(map);
    TraversabilityMap full({square_robot(), tall_robot()});
    (void)full.update(map);
    for (const char* robot : {"square", "tall"}) {
      expect_same(*incremental.view(robot), *full.view(robot));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(TraversabilityMap, TileSides, ::testing::Values(20, 60));

TEST(TraversabilityMap, CanBeHeldUpBetweenTiles) {
  VoxelWorld world(20);
  world.ground(-18, -18, 18, 18, road);
  TraversabilityMap map({square_robot()});
  std::atomic<int> pauses = 0;
  const TraversabilityUpdate update = map.update(world.view(), [&] { ++pauses; });
  EXPECT_EQ(pauses, update.map_tiles + update.surfaces + update.classified);
}

TEST(TraversabilityMap, AChangeReachesOnlyTheNeighboursNearIt) {
  VoxelWorld world(100);
  world.ground(-30, -30, 30, 30, road);
  TraversabilityMap area({square_robot()});
  (void)area.update(world.view());
  world.block(9.0, 9.0, 9.4, 9.4, 0.3, 2.0, pole);  // in the middle of its tile of 20 m
  EXPECT_EQ(area.update(world.view()).surfaces, 1U);
  world.block(1.0, 9.0, 1.4, 9.4, 0.3, 2.0, pole);  // near its left edge
  const TraversabilityUpdate work = area.update(world.view());
  EXPECT_EQ(work.surfaces, 2U);
  EXPECT_EQ(work.classified, 2U);
}

TEST(TraversabilityMap, TilesThatGoTakeTheirInfluenceAlong) {
  VoxelWorld world;
  world.ground(-12, -12, 12, 12, road);
  world.block(4.0, 0.0, 8.0, 4.0, 0.3, 2.0, building);
  TraversabilityMap incremental({square_robot()});
  (void)incremental.update(world.view());
  world.clear(4.0, 0.0, 8.0, 4.0);  // exactly one tile
  const MapSnapshot map = world.view();
  EXPECT_EQ(incremental.update(map).map_tiles, 1U);
  TraversabilityMap full({square_robot()});
  (void)full.update(map);
  expect_same(*incremental.view("square"), *full.view("square"));
  EXPECT_EQ(test::look(*incremental.view("square"), 3.9, 1.1).cell.reason, BlockReason::none);
}

TEST(TraversabilityMap, AChangeInsideATileStaysAmongItsNeighbours) {
  VoxelWorld world;
  world.ground(-20, -20, 20, 20, road);
  TraversabilityMap area({square_robot()});
  (void)area.update(world.view());
  const auto before = area.view("square");
  world.block(1.8, 1.8, 2.2, 2.2, 0.3, 2.0, pole);
  const TraversabilityUpdate work = area.update(world.view());
  EXPECT_EQ(work.map_tiles, 1U);
  EXPECT_LE(work.surfaces, 9U);
  EXPECT_LE(work.classified, 9U);
  std::size_t shared = 0;
  const auto after = area.view("square");
  for (std::size_t i = 0; i < after->tiles.size(); ++i) {
    if (after->tiles[i] == before->tiles[i]) ++shared;
  }
  // The pole is 1.8 m from its tile's edge and the safety margin reaches 2 m.
  EXPECT_GE(shared, after->tiles.size() - 9);
  EXPECT_LT(shared, after->tiles.size());
}

TEST(TraversabilityMap, NothingIsDoneWhenNothingChanged) {
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  TraversabilityMap area({square_robot()});
  (void)area.update(world.view());
  const auto before = area.view("square")->tiles;
  const TraversabilityUpdate work = area.update(world.view());
  EXPECT_EQ(work.map_tiles + work.surfaces + work.classified, 0U);
  EXPECT_EQ(area.view("square")->tiles, before);
}

TEST(TraversabilityMap, AnotherMapSharesNothingWithTheLast) {
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  MapSnapshot map = world.view();
  TraversabilityMap area({square_robot()});
  (void)area.update(map);
  map.map_id = 2;
  EXPECT_EQ(area.update(map).map_tiles, map.tiles.size());
  EXPECT_EQ(area.view("square")->map_id, 2U);
}

TEST(TraversabilityMap, SurvivesAnEmptyMapBetweenOthers) {
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  TraversabilityMap area({square_robot()});
  (void)area.update(MapSnapshot{});
  EXPECT_TRUE(area.view("square")->tiles.empty());
  (void)area.update(world.view());
  EXPECT_FALSE(area.view("square")->tiles.empty());
  (void)area.update(MapSnapshot{});
  EXPECT_TRUE(area.view("square")->tiles.empty());
}

TEST(TraversabilityMap, OldViewsStayAsTheyWere) {
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  TraversabilityMap area({square_robot()});
  (void)area.update(world.view());
  const auto before = area.view("square");
  world.block(0, 0, 1, 1, 0.3, 2.0, building);
  (void)area.update(world.view());
  EXPECT_EQ(test::look(*before, 0.5, 0.5).cell.state, CellState::free);
  EXPECT_EQ(test::look(*area.view("square"), 0.5, 0.5).cell.reason, BlockReason::obstacle);
}

TEST(TraversabilityMap, VoxelsBeyondTheTilesColumnsAreLeftOut) {
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  MapSnapshot map = world.view();
  Tile broken = *map.tiles.front();
  std::vector<Voxel> voxels(broken.voxels.begin(), broken.voxels.end());
  voxels.back().index.x = 255;
  broken.voxels = PackedVoxels(broken.info.id, broken.voxels.grid(), voxels);
  broken.info.revision = 99;
  map.tiles.set(std::make_shared<const Tile>(broken));
  TraversabilityMap area({square_robot()});
  EXPECT_NO_THROW((void)area.update(map));
}
TEST(TraversabilityMap, RefusesWhatItCannotWorkWith) {
  RobotProfile broken = square_robot();
  broken.max_step_m = -1.0;
  EXPECT_THROW(TraversabilityMap({broken}), std::invalid_argument);
  EXPECT_THROW(TraversabilityMap({square_robot(), square_robot()}), std::invalid_argument);
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  MapSnapshot map = world.view();
  map.voxel_size_m = 0.3;
  TraversabilityMap area({square_robot()});
  EXPECT_THROW((void)area.update(map), std::invalid_argument);
}

TEST(TraversabilityMap, HasNoViewOfAProfileItDoesNotKnow) {
  EXPECT_EQ(TraversabilityMap({square_robot()}).view("round"), nullptr);
}

TEST(TraversabilityMap, RefusesARobotThatIsLargerThanTiles) {
  RobotProfile robot = square_robot();
  robot.length_m = robot.width_m = 2.2;
  VoxelWorld world(5);
  world.ground(-4, -4, 4, 4, road);
  robot.name = "wide";
  TraversabilityMap of_wide({square_robot(), robot});
  EXPECT_THAT(
      [&] { (void)of_wide.update(world.view()); },
      testing::ThrowsMessage<std::invalid_argument>(testing::AllOf(
          HasSubstr("'wide'"), HasSubstr("1.1 m"), HasSubstr("static_map.tile_size_m = 1"))));
  robot.length_m = robot.width_m = 2.0;
  EXPECT_NO_THROW((void)TraversabilityMap({robot}).update(world.view()));
}

}  // namespace
}  // namespace stillmap
