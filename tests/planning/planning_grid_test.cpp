#include "core/planning/planning_grid.hpp"

#include <gtest/gtest.h>

#include <random>

#include "core/traversability/path_check.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

/// A road with posts and a hole, 24 m square.
VoxelWorld road_with_posts() {
  VoxelWorld world;
  world.ground(-12, -12, 12, 12, road);
  world.clear(4, 4, 12, 12);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-11.0, 11.0);
  for (int i = 0; i < 12; ++i) {
    const double x = place(random);
    const double y = place(random);
    world.block(x, y, x + 0.4, y + 0.4, 0.3, 2.0, pole);
  }
  return world;
}

void expect_agreement(const RobotProfile& robot, int seed) {
  const auto view = traversability_of(road_with_posts().view(), robot);
  const Eigen::AlignedBox2d box(Eigen::Vector2d(-14, -14), Eigen::Vector2d(14, 14));
  const PlanningGrid grid(*view, box, 1.0);
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> place(-14.0, 14.0);
  std::uniform_real_distribution<double> heading(-4.0, 4.0);
  int free = 0;
  constexpr int poses = 3000;
  for (int i = 0; i < poses; ++i) {
    const PlanarPose pose{{place(random), place(random)}, heading(random)};
    const bool is_free = check_path(*view, std::span(&pose, 1)).is_free;
    free += is_free ? 1 : 0;
    ASSERT_EQ(grid.is_free(pose), is_free)
        << pose.position_map.transpose() << ", " << pose.heading_rad;
    if (is_free) {
      ASSERT_TRUE(grid.may_stand_in(grid.cell_of(pose.position_map)));
    }
  }
  EXPECT_GT(free, poses / 20);
  EXPECT_LT(free, poses - poses / 20);
}

TEST(PlanningGrid, AgreesWithThePathCheckOnEveryPose) {
  RobotProfile car = square_robot();
  car.length_m = 4.4;
  car.width_m = 1.8;
  car.centre_ahead_m = 1.2;
  expect_agreement(square_robot(), 1);
  expect_agreement(car, 2);
  car.unknown = UnknownGround::allowed;
  expect_agreement(car, 3);
}

TEST(PlanningGrid, NoPoseIsFreeOutsideItsBox) {
  RobotProfile robot = square_robot();
  robot.unknown = UnknownGround::allowed;
  const auto view = traversability_of(road_with_posts().view(), robot);
  const PlanningGrid grid(*view, {Eigen::Vector2d(-14, -14), Eigen::Vector2d(14, 14)}, 1.0);
  EXPECT_TRUE(grid.is_free({{-13.9, 0}, 0}));
  EXPECT_FALSE(grid.is_free({{-14.1, 0}, 0}));
  EXPECT_FALSE(grid.is_free({{1e9, 0}, 0}));
}

TEST(PlanningGrid, CostlyGroundCostsMoreByTheWeight) {
  VoxelWorld world;
  world.ground(-8, -8, 8, 0, road);
  world.ground(-8, 0, 8, 8, parking);
  const auto view = traversability_of(world.view(), square_robot());
  const PlanningGrid grid(*view, view->bounds_map(), 4.0);
  EXPECT_FLOAT_EQ(static_cast<float>(grid.cost_factor(grid.cell_of({0, -4}))), 1.0F);
  EXPECT_NEAR(grid.cost_factor(grid.cell_of({0, 4})), 1.0 + 4.0 * 0.2, 0.05);
}

}  // namespace
}  // namespace stillmap
