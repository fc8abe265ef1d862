#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/traversability/path_check.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::look;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

RobotProfile robot_on(SemanticClass label) {
  RobotProfile robot = square_robot();
  robot.class_cost.at(static_cast<std::size_t>(label)) = 0.0;
  return robot;
}

/// Level ground, densely seen, but for a strip of water through the origin at an angle to x.
VoxelWorld canal(double width_m, double angle_rad, SemanticClass label) {
  VoxelWorld world;
  world.ground(-12, -12, 12, 12, label);
  for (double x_m = -11.9; x_m < 12.0; x_m += 0.2) {
    for (double y_m = -11.9; y_m < 12.0; y_m += 0.2) {
      const double across_m = y_m * std::cos(angle_rad) - x_m * std::sin(angle_rad);
      if (std::abs(across_m) < 0.5 * width_m)
        world.clear(x_m - 0.1, y_m - 0.1, x_m + 0.1, y_m + 0.1);
    }
  }
  return world;
}

TEST(StripWithoutReturns, BetweenLevelBanksIsUnknownWhateverItsDirection) {
  for (const SemanticClass label : {road, unlabeled}) {
    for (const double width_m : {1.4, 2.0, 3.0, 4.0}) {
      for (const double angle_deg : {0.0, 13.0, 27.0, 45.0}) {
        const double angle_rad = angle_deg * std::numbers::pi / 180.0;
        const auto view =
            traversability_of(canal(width_m, angle_rad, label).view(), robot_on(label));
        EXPECT_EQ(look(*view, 0.1, 0.1).cell.state, CellState::unknown)
            << name(label) << ", " << width_m << " m, " << angle_deg << " degrees";
        const Eigen::Vector2d across(-std::sin(angle_rad), std::cos(angle_rad));
        const double heading_rad = angle_rad + 0.5 * std::numbers::pi;
        const std::vector<PlanarPose> path{{-3.5 * across, heading_rad},
                                           {3.5 * across, heading_rad}};
        EXPECT_FALSE(check_path(*view, path).is_free)
            << name(label) << ", " << width_m << " m, " << angle_deg << " degrees";
      }
    }
  }
}

TEST(StripWithoutReturns, BetweenTheRingsOfALidarIsGround) {
  // Rings ahead of where a robot stopped: a row of cells each, a gap before and behind.
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, road);
  for (double y_m = -2.8; y_m < 5.0; y_m += 1.4) world.clear(-6, y_m, 6, y_m + 1.2);
  const auto view = traversability_of(world.view(), square_robot());
  for (double y_m = -2.7; y_m < 4.0; y_m += 0.2)
    EXPECT_EQ(look(*view, 0.1, y_m).cell.state, CellState::free) << y_m;
}

}  // namespace
}  // namespace stillmap
