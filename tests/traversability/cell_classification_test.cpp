#include <gtest/gtest.h>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::look;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

VoxelWorld plain_road() {
  VoxelWorld world;
  world.ground(-8, -8, 8, 8, road);
  return world;
}

TEST(CellClassification, AKerbIsAStepForOneRobotAndNoneForAnother) {
  VoxelWorld world = plain_road();
  world.ground(-8, 2, 8, 8, road, [](double, double) { return 0.23; });
  RobotProfile robot = square_robot();
  EXPECT_EQ(look(*traversability_of(world.view(), robot), 0.1, 2.1).cell.reason, BlockReason::step);
  robot.max_step_m = 0.2;
  EXPECT_EQ(look(*traversability_of(world.view(), robot), 0.1, 2.1).cell.state, CellState::free);
}

TEST(CellClassification, StandingObjectsAreObstaclesHangingOnesLowHeadroom) {
  VoxelWorld world = plain_road();
  world.block(2.0, 2.0, 2.2, 2.2, 0.3, 2.0, pole);
  world.block(-3.0, 2.0, -2.0, 3.0, 1.3, 1.9, vegetation);
  world.block(-3.0, -3.0, -2.0, -2.0, 1.8, 2.4, building);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 2.1, 2.1).cell.reason, BlockReason::obstacle);
  EXPECT_EQ(look(*view, -2.5, 2.5).cell.reason, BlockReason::low_headroom);
  EXPECT_EQ(look(*view, -2.5, -2.5).cell.state, CellState::free);
}

TEST(CellClassification, SlopeRoughnessAndClassHaveTheirOwnReasons) {
  VoxelWorld world;
  world.ground(-8, -8, 0, 8, road, [](double x, double) { return 0.5 * x; });
  world.ground(0, -8, 8, 0, road,
               [](double x, double y) { return 0.07 * std::sin(9.0 * x) * std::sin(9.0 * y); });
  world.ground(0, 0, 8, 8, terrain);
  RobotProfile robot = square_robot();
  robot.max_step_m = 0.3;
  const auto view = traversability_of(world.view(), robot);
  EXPECT_EQ(look(*view, -4.1, 0.1).cell.reason, BlockReason::slope);
  EXPECT_EQ(look(*view, 4.1, 4.1).cell.reason, BlockReason::ground_class);
  robot.max_roughness_m = 0.01;
  EXPECT_EQ(look(*traversability_of(world.view(), robot), 4.1, -4.1).cell.reason,
            BlockReason::roughness);
}

TEST(CellClassification, UnknownIsNotLethalAndHasNoInscribedCellsAround) {
  VoxelWorld world;
  world.ground(-8, -8, 2, 8, road);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 2.1, 0.1).cell.state, CellState::unknown);
  EXPECT_EQ(look(*view, 1.9, 0.1).cell.state, CellState::free);
  EXPECT_EQ(look(*view, 50.0, 0.1).cell.state, CellState::unknown);
}

TEST(CellClassification, CellsWithinTheInscribedRadiusAreInscribedAndThenTheCostFalls) {
  VoxelWorld world = plain_road();
  world.block(0.0, 0.0, 0.2, 0.2, 0.3, 1.5, pole);
  RobotProfile robot = square_robot();
  robot.length_m = 2.0;
  const auto view = traversability_of(world.view(), robot);
  int last_cost = 100;
  for (double x_m = 0.1; x_m < 2.0; x_m += 0.2) {
    const TraversabilityCell cell = look(*view, x_m, 0.1).cell;
    const double distance_m = x_m - 0.1;
    EXPECT_NEAR(cell.clearance_m, distance_m, 1e-5);
    const BlockReason reason = x_m < 0.2                                  ? BlockReason::obstacle
                               : distance_m <= robot.inscribed_radius_m() ? BlockReason::inscribed
                                                                          : BlockReason::none;
    EXPECT_EQ(cell.reason, reason) << x_m;
    EXPECT_LE(cell.cost, last_cost);
    last_cost = cell.cost;
  }
  EXPECT_EQ(look(*view, 0.1, 0.1).cell.cost, 100);
  EXPECT_EQ(look(*view, 0.3, 0.1).cell.cost, 99);
  EXPECT_EQ(last_cost, 0);
}

TEST(CellClassification, InscribedCellsCrossTheEdgesOfTiles) {
  VoxelWorld world = plain_road();
  world.block(4.0, 0.0, 4.2, 0.2, 0.3, 1.5, pole);  // first column of its tile
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 3.9, 0.1).cell.reason, BlockReason::inscribed);
  EXPECT_EQ(look(*view, 3.9, -0.1).cell.reason, BlockReason::inscribed);
}

TEST(CellClassification, CostGrowsWithClassSlopeAndInference) {
  VoxelWorld world = plain_road();
  world.ground(-8, 0, 0, 8, parking);
  world.ground(0, 0, 8, 8, road, [](double x, double) { return 0.1 + 0.2 * x; });
  world.clear(4.0, -5.0, 4.4, -4.6);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 4.9, -4.9).cell.cost, 0);
  EXPECT_EQ(look(*view, -4.1, 4.1).cell.cost, 20);  // 0.2 of 98
  EXPECT_GT(look(*view, 6.1, 6.1).cell.cost, 20);
  EXPECT_TRUE(look(*view, 4.1, -4.9).cell.inferred);
  EXPECT_EQ(look(*view, 4.1, -4.9).cell.cost, 10);
}

TEST(CellClassification, AWallOnUnknownGroundIsAnObstacle) {
  VoxelWorld world = plain_road();
  world.clear(4, -8, 8, 8);
  world.block(5.0, -8, 5.2, 8, 0.5, 3.0, building);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 5.1, 0.1).cell.reason, BlockReason::obstacle);
  EXPECT_EQ(look(*view, 6.1, 0.1).cell.state, CellState::unknown);
}

TEST(CellClassification, ABeamIsAsLowAsItsLowestVoxelMayReach) {
  VoxelWorld world = plain_road();
  // Means of voxels from 1.6 to 1.8 m: above the ground, 1.5 m, or half a cell below the mean.
  world.block(-3.0, -3.0, -2.0, -2.0, 1.65, 1.75, building);
  world.block(2.0, 2.0, 3.0, 3.0, 1.75, 1.85, building);
  RobotProfile robot = square_robot();
  const auto low_headroom_for = [&](double height_m, double x_m) {
    robot.height_m = height_m;
    return look(*traversability_of(world.view(), robot), x_m, x_m).cell.reason ==
           BlockReason::low_headroom;
  };
  EXPECT_FALSE(low_headroom_for(1.49, -2.5));
  EXPECT_TRUE(low_headroom_for(1.52, -2.5));
  EXPECT_FALSE(low_headroom_for(1.54, 2.5));
  EXPECT_TRUE(low_headroom_for(1.56, 2.5));
}

}  // namespace
}  // namespace stillmap
