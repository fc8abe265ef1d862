#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/traversability/path_check.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::look;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

/// A robot of 0.6 m on ground without a class, for slopes up to 15 degrees and steps up to 5 cm.
RobotProfile indoor_robot() {
  RobotProfile robot = square_robot();
  robot.length_m = robot.width_m = 0.6;
  robot.max_step_m = 0.05;
  robot.max_slope_deg = 15.0;
  robot.class_cost.at(static_cast<std::size_t>(unlabeled)) = 0.0;
  return robot;
}

/// A wall without a class. Its lowest voxel holds its foot and the floor, and lies above that.
void add_wall(VoxelWorld& world, double x0, double y0, double x1, double y1) {
  world.ground(x0, y0, x1, y1, unlabeled, [](double, double) { return 0.17; });
  world.block(x0, y0, x1, y1, 0.3, 2.0, unlabeled);
}

bool is_free(const TraversabilityView& view, Eigen::Vector2d from, Eigen::Vector2d to) {
  const Eigen::Vector2d way = to - from;
  const double heading_rad = std::atan2(way.y(), way.x());
  return check_path(view, std::vector<PlanarPose>{{from, heading_rad}, {to, heading_rad}}).is_free;
}

TEST(UnlabelledGround, TheFootOfAWallIsNoStepBesideIt) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, unlabeled);
  add_wall(world, -6, 1, -0.4, 1.2);
  add_wall(world, 0.4, 1, 6, 1.2);
  const auto view = traversability_of(world.view(), indoor_robot());
  EXPECT_EQ(look(*view, -2.1, 1.1).cell.reason, BlockReason::obstacle);
  EXPECT_EQ(look(*view, -2.1, 0.9).cell.reason, BlockReason::inscribed);
  EXPECT_TRUE(is_free(*view, {0, -1}, {0, 3})) << "a door of 0.8 m";
  EXPECT_FALSE(is_free(*view, {-2, -1}, {-2, 3})) << "the wall beside it";
}

/// Height of a ramp along x from 0, 3 m wide round y = 0, that leads up or down to a level place.
double ramp_m(double x_m, double rise_m) {
  const double length_m = 7.0 * std::abs(rise_m);
  return 0.1 + rise_m * std::clamp(x_m / length_m, 0.0, 1.0);
}

/// A ramp without a class and where it leads to, with walls beside it, in the midst of level
/// ground.
VoxelWorld ramp_world(double rise_m) {
  VoxelWorld world(100);
  world.ground(-8, -8, 16, 8, unlabeled);
  world.ground(0, -1.6, 14, 1.6, unlabeled, [&](double x, double) { return ramp_m(x, rise_m); });
  for (double x_m = 0.2; x_m < 14.0; x_m += 0.2) {
    const double low_m = std::min(0.1, ramp_m(x_m + 0.1, rise_m));
    const double high_m = std::max(0.1, ramp_m(x_m + 0.1, rise_m));
    for (const double y_m : {-1.6, 1.4}) {
      world.clear(x_m, y_m, x_m + 0.2, y_m + 0.2);
      world.block(x_m, y_m, x_m + 0.2, y_m + 0.2, low_m, high_m + 0.05, unlabeled);
    }
  }
  return world;
}

TEST(UnlabelledGround, GoesOnOverARampAndWhereThatLeadsTo) {
  for (const double rise_m : {1.2, -1.2, -2.0}) {
    const auto view = traversability_of(ramp_world(rise_m).view(), indoor_robot());
    for (double x_m = 0.5; x_m < 13.0; x_m += 0.4) {
      const auto found = look(*view, x_m, 0.1);
      ASSERT_NE(found.surface, nullptr);
      EXPECT_EQ(found.surface->ground.origin, GroundOrigin::seen) << rise_m << " at " << x_m;
      EXPECT_NEAR(found.surface->ground.height_m, ramp_m(x_m, rise_m), 0.05);
    }
    EXPECT_TRUE(is_free(*view, {-3, 0}, {12, 0})) << rise_m;
    EXPECT_FALSE(is_free(*view, {11, 0}, {11, 5})) << "over its edge, " << rise_m;
    EXPECT_FALSE(is_free(*view, {11, 5}, {11, 0})) << "over its edge, " << rise_m;
  }
}

TEST(UnlabelledGround, BelowAWallItsSlopeIsNotThatUpToTheGroundAboveIt) {
  const auto view = traversability_of(ramp_world(-1.2).view(), indoor_robot());
  for (double x_m = 5.1; x_m < 13.0; x_m += 0.4) {
    EXPECT_LT(look(*view, x_m, -1.1).surface->shape.slope, 0.15) << x_m;
    EXPECT_LT(look(*view, x_m, -1.3).surface->shape.step_m, 0.05) << x_m;
  }
}

TEST(UnlabelledGround, DoesNotGoOnFromTheGroundOntoWhatStandsOnIt) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, unlabeled);
  // A car whose sides were seen from the sill up, and its bonnet and roof.
  world.clear(-2, -0.8, 2, 0.8);
  world.block(-2, -0.8, 2, 0.8, 0.35, 0.9, unlabeled);
  world.clear(-1.8, -0.6, 1.8, 0.6);
  world.ground(-1.8, -0.6, 1.8, 0.6, unlabeled,
               [](double x, double) { return x > 0.6 ? 0.9 : 1.5; });
  const auto view = traversability_of(world.view(), indoor_robot());
  for (const double x_m : {-1.1, 0.1, 1.1}) {
    EXPECT_NE(look(*view, x_m, 0.1).surface->ground.origin, GroundOrigin::seen) << x_m;
    EXPECT_EQ(look(*view, x_m, 0.1).cell.state, CellState::lethal) << x_m;
  }
}

}  // namespace
}  // namespace stillmap
