#include "core/planning/path_smoother.hpp"

#include <gtest/gtest.h>

#include <array>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

class PathSmootherTest : public testing::Test {
 protected:
  PathSmootherTest() { world_.ground(-20, -20, 20, 20, road); }

  [[nodiscard]] CollisionChecker checker() {
    view_ = traversability_of(world_.view(), square_robot());
    grid_.emplace(*view_, view_->bounds_map(), 4.0);
    return CollisionChecker(*grid_, 3.0);
  }

  VoxelWorld world_;
  std::shared_ptr<const TraversabilityView> view_;
  std::optional<PlanningGrid> grid_;
};

TEST_F(PathSmootherTest, ADetourOverOpenGroundBecomesNearlyStraight) {
  const CollisionChecker check = checker();
  const auto detour =
      connect_waypoints(check, std::array{PlanarPose{{-15, 0}, 0}, PlanarPose{{-5, 9}, 1.0},
                                          PlanarPose{{4, -8}, 0}, PlanarPose{{15, 0}, 0}});
  ASSERT_TRUE(detour);
  const auto smoothed = smooth_path(check, *detour, {}, 1000, 1, {});
  EXPECT_GT(detour->back().cost, 45.0);
  EXPECT_LT(smoothed.back().cost, 31.0);
  EXPECT_EQ(smoothed.back().at.pose.position_map, Eigen::Vector2d(15, 0));
}

TEST_F(PathSmootherTest, StaysFreeAndItsCostsAddUp) {
  world_.block(-1, -20, 1, 6, 0.3, 2.0, building);
  const CollisionChecker check = checker();
  const auto path = connect_waypoints(
      check, std::array{PlanarPose{{-15, -9}, 0}, PlanarPose{{0, 14}, 0}, PlanarPose{{15, -9}, 0}});
  ASSERT_TRUE(path);
  const auto smoothed = smooth_path(check, *path, {}, 1000, 1, {});
  EXPECT_LT(smoothed.back().cost, path->back().cost);
  double length_m = 0.0;
  for (std::size_t i = 1; i < smoothed.size(); ++i) {
    EXPECT_TRUE(grid_->is_free(smoothed[i].at.pose));
    EXPECT_GE(smoothed[i].cost, smoothed[i - 1].cost);
    length_m += smoothed[i].at.step_m;
  }
  EXPECT_GE(smoothed.back().cost, length_m - 1e-6);
}

TEST_F(PathSmootherTest, EndsInTheEndThatCostsLeast) {
  const CollisionChecker check = checker();
  // Turned round at the goal, though any heading would do.
  const std::array ends{PlanarPose{{15, 0}, 3.1}, PlanarPose{{15, 0}, 0.0}};
  const auto path = connect_waypoints(check, std::array{PlanarPose{{-15, 0}, 0}, ends[0]});
  ASSERT_TRUE(path);
  const auto smoothed = smooth_path(check, *path, ends, 1000, 1, {});
  EXPECT_EQ(smoothed.back().at.pose.heading_rad, 0.0);
  EXPECT_LT(smoothed.back().cost, 30.1);
}

TEST_F(PathSmootherTest, ThroughAWallThereIsNoPath) {
  world_.block(-1, -20, 1, 20, 0.3, 2.0, building);
  EXPECT_FALSE(
      connect_waypoints(checker(), std::array{PlanarPose{{-9, 0}, 0}, PlanarPose{{9, 0}, 0}}));
}

TEST_F(PathSmootherTest, DownsamplingKeepsEndsLengthAndReversals) {
  const CollisionChecker check = checker();
  // Beside and back: forwards, then backwards.
  const auto path = connect_waypoints(
      check, std::array{PlanarPose{{0, 0}, 0}, PlanarPose{{6, 0}, 0}, PlanarPose{{2, 0}, 0}});
  ASSERT_TRUE(path);
  const auto few = downsampled(*path, 0.5);
  EXPECT_LT(few.size(), path->size() / 3);
  EXPECT_EQ(few.back().at.pose.position_map, Eigen::Vector2d(2, 0));
  double length_m = 0.0;
  double farthest_m = 0.0;
  for (const PathPoint& pose : few) {
    length_m += pose.at.step_m;
    farthest_m = std::max(farthest_m, pose.at.pose.position_map.x());
  }
  EXPECT_NEAR(length_m, 10.0, 1e-9);
  EXPECT_NEAR(farthest_m, 6.0, 1e-9);
}

}  // namespace
}  // namespace stillmap
