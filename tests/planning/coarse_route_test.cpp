#include "core/planning/coarse_route.hpp"

#include <gtest/gtest.h>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

/// A road 24 m square with a wall across it that ends 3 m before its side.
VoxelWorld walled_road(double wall_end_y = 9.0) {
  VoxelWorld world;
  world.ground(-12, -12, 12, 12, road);
  world.block(0, -12, 0.4, wall_end_y, 0.3, 2.0, building);
  return world;
}

std::optional<CoarseRoute> route(const VoxelWorld& world, const Eigen::Vector2d& from,
                                 const Eigen::Vector2d& to) {
  VoxelWorld copy = world;
  const auto view = traversability_of(copy.view(), square_robot());
  return find_coarse_route(PlanningGrid(*view, view->bounds_map(), 4.0), from, to);
}

TEST(CoarseRoute, GoesRoundTheWallInSmallSteps) {
  const auto found = route(walled_road(), {-6, -6}, {6, -6});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->points_map.front(), Eigen::Vector2d(-6, -6));
  EXPECT_EQ(found->points_map.back(), Eigen::Vector2d(6, -6));
  // To the wall's end and back.
  const double taut_m = 2.0 * std::hypot(6.0, 15.5);
  EXPECT_GT(found->length_m, taut_m - 1.0);
  EXPECT_LT(found->length_m, 1.12 * taut_m);
  for (std::size_t i = 1; i < found->points_map.size(); ++i) {
    EXPECT_LT((found->points_map[i] - found->points_map[i - 1]).norm(), 2.0 * found->step_m);
  }
}

TEST(CoarseRoute, ThereIsNoneThroughAWallOrToUnknownGround) {
  EXPECT_FALSE(route(walled_road(12.0), {-6, -6}, {6, -6}));
  VoxelWorld island = walled_road();
  // Farther than holes are filled.
  island.clear(1, -4, 12, 12);
  island.ground(9, 9, 12, 12, road);
  EXPECT_FALSE(route(island, {-6, -6}, {10.5, 10.5}));
}

TEST(CoarseRoute, FromAPositionToItselfTheLengthIsZero) {
  const auto found = route(walled_road(), {-6, -6}, {-6, -6});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->length_m, 0.0);
}

}  // namespace
}  // namespace stillmap
