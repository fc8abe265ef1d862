#include <gtest/gtest.h>

#include <random>

#include "core/planning/path_planner.hpp"
#include "tests/planning/grid_optimum.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::traversability_of;
using test::VoxelWorld;

/// A yard 40 m square with walls at random.
VoxelWorld maze(int seed) {
  VoxelWorld world;
  world.ground(-20, -20, 20, 20, road);
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> place(-19.0, 19.0);
  std::uniform_real_distribution<double> length(3.0, 16.0);
  for (int i = 0; i < 14; ++i) {
    const double x = place(random);
    const double y = place(random);
    const double side = length(random);
    const bool along_x = i % 2 == 0;
    world.block(x, y, x + (along_x ? side : 0.6), y + (along_x ? 0.6 : side), 0.3, 2.0, building);
  }
  return world;
}

TEST(PathOracle, FindsAPathWheneverTheGridHasOneAndNotMuchLonger) {
  constexpr double allowed_factor = 1.15;
  const Eigen::Vector2d from(-17, -17);
  const Eigen::Vector2d to(17, 17);
  PlanningConfig config;
  config.cost_weight = 0.0;  // cost is length, as on the grid
  int paths = 0;
  for (int seed = 1; seed <= 8; ++seed) {
    const auto view = traversability_of(maze(seed).view(), test::square_robot());
    const auto optimum_m = test::shortest_path_m(*view, from, to);
    if (!optimum_m) continue;
    ++paths;
    const PathPlan plan = plan_path(*view, {from, {}}, {to, {}}, config);
    ASSERT_EQ(plan.status, PlanStatus::found) << "maze " << seed << ": " << plan.reason;
    EXPECT_LT(plan.cost, allowed_factor * *optimum_m) << "maze " << seed;
    EXPECT_TRUE(check_path(*view, plan.path_map()).is_free);
  }
  EXPECT_GE(paths, 4);
}

}  // namespace
}  // namespace stillmap
