#include <gtest/gtest.h>

#include <random>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::look;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

TEST(Ground, FollowsASlopeWithinAMillimetre) {
  VoxelWorld world;
  const auto slope = [](double x_m, double y_m) { return 0.1 * x_m - 0.05 * y_m; };
  world.ground(-6, -6, 6, 6, road, slope);
  const auto view = traversability_of(world.view(), square_robot());
  for (const double x_m : {-3.1, 0.1, 2.9}) {
    const auto found = look(*view, x_m, 0.5);
    ASSERT_NE(found.surface, nullptr);
    EXPECT_EQ(found.surface->ground.origin, GroundOrigin::seen);
    EXPECT_NEAR(found.surface->ground.height_m, slope(x_m, 0.5), 1e-3);
  }
}

TEST(Ground, IsBelowABridgeAndACanopy) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, road);
  world.block(-2, -6, 2, 6, 4.9, 5.3, road);      // a bridge's deck
  world.block(3, 3, 5, 5, 2.5, 4.5, vegetation);  // a tree's crown
  const auto view = traversability_of(world.view(), square_robot());
  for (const double x_m : {0.1, 4.1}) {
    const auto found = look(*view, x_m, 4.1);
    EXPECT_NEAR(found.surface->ground.height_m, 0.1, 1e-6);
    EXPECT_EQ(found.cell.state, CellState::free) << x_m;
  }
}

TEST(Ground, WithoutClassesIsTheLowestSurfaceNearTheLevelAround) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, unlabeled);
  world.block(0, 0, 2, 2, 0.3, 2.0, unlabeled);  // a box on the ground
  world.clear(-4, -4, -3, -3);
  world.block(-4, -4, -3, -3, 1.5, 2.5, unlabeled);  // leaves over a place that was not seen
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_NEAR(look(*view, 1.1, 1.1).surface->ground.height_m, 0.1, 1e-6);
  EXPECT_EQ(look(*view, 1.1, 1.1).cell.reason, BlockReason::obstacle);
  EXPECT_NE(look(*view, -3.5, -3.5).surface->ground.origin, GroundOrigin::seen);
  EXPECT_NEAR(look(*view, -3.5, -3.5).surface->ground.height_m, 0.1, 0.02);
  EXPECT_EQ(look(*view, 4.1, 4.1).cell.state, CellState::free);
}

TEST(Ground, AMirrorImageUnderTheRoadIsNotGround) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, road);
  world.clear(1.0, 1.0, 1.2, 1.2);
  world.block(1.0, 1.0, 1.2, 1.2, -1.1, -0.9, road);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 1.1, 1.1).surface->ground.origin, GroundOrigin::inferred);
  EXPECT_NEAR(look(*view, 1.1, 1.1).surface->ground.height_m, 0.1, 1e-3);
}

TEST(Ground, ACarsRoofTakenForRoadIsAThingAndNotGround) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, road);
  world.clear(3.0, 1.0, 3.2, 1.2);
  world.block(3.0, 1.0, 3.2, 1.2, 1.1, 1.3, road);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 3.1, 1.1).surface->ground.origin, GroundOrigin::assumed);
  EXPECT_EQ(look(*view, 3.1, 1.1).cell.reason, BlockReason::low_headroom);
}

TEST(Ground, ALoneCellOfAnotherClassTakesThatOfItsNeighbours) {
  VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  world.ground(1.0, 1.0, 1.2, 1.2, terrain);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 1.1, 1.1).surface->ground.label, road);
}

TEST(Ground, StandsWhereNoiseIsASmallPartOfTheStep) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise_m(0.0, 0.01);
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, road, [&](double, double) { return 0.1 + noise_m(random); });
  const auto view = traversability_of(world.view(), square_robot());
  int lethal = 0;
  for (double x_m = -4.9; x_m < 5; x_m += 0.2) {
    for (double y_m = -4.9; y_m < 5; y_m += 0.2) {
      if (look(*view, x_m, y_m).cell.state == CellState::lethal) ++lethal;
    }
  }
  EXPECT_EQ(lethal, 0);
}

TEST(Ground, ASteepSlopeWithoutLabelsIsSeenAllOverIt) {
  VoxelWorld world;
  const auto slope = [](double x_m, double y_m) { return 0.46 * x_m + 0.1 * y_m; };
  world.ground(-7, -7, 7, 7, unlabeled, slope);
  const auto view = traversability_of(world.view(), square_robot());
  for (double x_m = -3.9; x_m < 4.0; x_m += 0.2) {
    for (double y_m = -3.9; y_m < 4.0; y_m += 0.2) {
      const GroundCell& ground = look(*view, x_m, y_m).surface->ground;
      EXPECT_EQ(ground.origin, GroundOrigin::seen) << x_m << ", " << y_m;
      EXPECT_NEAR(ground.height_m, slope(x_m, y_m), 1e-3);
    }
  }
}

}  // namespace
}  // namespace stillmap
