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

/// Cells along a tile, so that the window round it is wider than the longest hole.
constexpr int wide_tile = 100;

/// Level ground, densely seen, but for a strip of water through the origin at an angle to x.
VoxelWorld canal(double width_m, double angle_rad, SemanticClass label) {
  VoxelWorld world(wide_tile);
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

/// Densely seen road with a rise to x, but for a hole of a length along x and a width.
VoxelWorld road_with_hole(double length_m, double width_m, double rise = 0.0) {
  VoxelWorld world(wide_tile);
  world.ground(-14, -6, 14, 6, road, [rise](double x, double) { return 0.1 + rise * x; });
  world.clear(-0.5 * length_m, -0.5 * width_m, 0.5 * length_m, 0.5 * width_m);
  return world;
}

/// Share of the cells in a rectangle about the origin that are free.
double free_share(const TraversabilityView& view, double length_m, double width_m) {
  int free = 0;
  int all = 0;
  for (double x = -0.5 * length_m + 0.1; x < 0.5 * length_m; x += 0.2) {
    for (double y = -0.5 * width_m + 0.1; y < 0.5 * width_m; y += 0.2) {
      free += look(view, x, y).cell.state == CellState::free ? 1 : 0;
      ++all;
    }
  }
  return static_cast<double>(free) / all;
}

TEST(StripWithoutReturns, IsNoLongerThanAVehicleWhereItIsGround) {
  for (const double rise : {0.0, 0.2}) {
    for (const double length_m : {4.8, 7.0}) {
      for (const double width_m : {2.0, 2.8}) {
        const auto view =
            traversability_of(road_with_hole(length_m, width_m, rise).view(), square_robot());
        EXPECT_EQ(free_share(*view, length_m, width_m), 1.0)
            << length_m << " x " << width_m << " m, rise " << rise;
      }
    }
    const auto lock = traversability_of(road_with_hole(11.0, 2.8, rise).view(), square_robot());
    EXPECT_LT(free_share(*lock, 8.0, 2.0), 0.01) << rise;
  }
}

TEST(StripWithoutReturns, OfOneMetreIsUnknownWhateverItsDirection) {
  for (int angle_deg = 0; angle_deg <= 90; angle_deg += 3) {
    const double angle_rad = angle_deg * std::numbers::pi / 180.0;
    const auto view = traversability_of(canal(1.1, angle_rad, road).view(), square_robot());
    EXPECT_EQ(look(*view, 0.01, 0.01).cell.state, CellState::unknown) << angle_deg << " degrees";
  }
}

TEST(StripWithoutReturns, DoesNotEndUnderBranchesNorAtWhatItMirrors) {
  for (const double width_m : {2.0, 3.0, 4.0}) {
    for (const double height_m : {3.0, -1.1}) {
      VoxelWorld world = canal(width_m, 0.0, road);
      for (double x_m = -11.0; x_m < 12.0; x_m += 4.0)
        world.block(x_m, -0.5 * width_m, x_m + 0.2, 0.5 * width_m, height_m, height_m + 0.1,
                    vegetation);
      const auto view = traversability_of(world.view(), square_robot());
      EXPECT_LT(free_share(*view, 16.0, width_m - 0.4), 0.01) << width_m << ", " << height_m;
      const double north_rad = 0.5 * std::numbers::pi;
      const std::vector<PlanarPose> path{{{2.1, -4.0}, north_rad}, {{2.1, 4.0}, north_rad}};
      EXPECT_FALSE(check_path(*view, path).is_free) << width_m << ", " << height_m;
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
