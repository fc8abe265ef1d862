#include "core/traversability/path_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::HasSubstr;

/// A lane along x with a wall beside it at y = 1, and from its end one along y. The robot is 2 m
/// long and 0.6 m wide.
std::shared_ptr<const TraversabilityView> bend() {
  VoxelWorld world;
  world.ground(-4, -2, 11, 1, road);
  world.ground(8, 1, 11, 12, road);
  world.block(-4, 1, 8, 1.4, 0.3, 2.0, building);
  RobotProfile robot = square_robot();
  robot.length_m = 2.0;
  robot.width_m = 0.6;
  return traversability_of(world.view(), robot);
}

PathQuery path(std::vector<Eigen::Vector2d> positions_map, std::vector<double> headings_rad = {}) {
  return {.profile = "",
          .positions_map = std::move(positions_map),
          .headings_rad = std::move(headings_rad)};
}

TEST(PathQuery, WithoutHeadingsTheRobotLooksAhead) {
  const PathCheck check = check_path(*bend(), path({{0, 0}, {9.5, 0}, {9.5, 9.5}}));
  EXPECT_TRUE(check.is_free);
  EXPECT_NEAR(check.checked_m, 19.0, 1e-6);
}

TEST(PathQuery, HeadingsAreTheRobotsNotThePaths) {
  const double across = std::numbers::pi / 2;
  EXPECT_TRUE(check_path(*bend(), path({{0, 0}, {4, 0}}, {0.0, 0.0})).is_free);
  const PathCheck sideways = check_path(*bend(), path({{0, 0}, {4, 0}}, {across, across}));
  ASSERT_TRUE(sideways.conflict);
  EXPECT_NEAR(std::abs(sideways.conflict->cell_centre_map.y()), 1.1, 0.11);
}

TEST(PathQuery, AConflictCountsThePositionsAsked) {
  const PathCheck check = check_path(*bend(), path({{0, 0}, {2, 0}, {4, -0.8}, {4, 8}}));
  ASSERT_TRUE(check.conflict);
  EXPECT_EQ(check.conflict->segment, 2U);
  EXPECT_EQ(check.conflict->reason, BlockReason::obstacle);
}

TEST(PathQuery, WaysOfNoLengthKeepTheHeading) {
  const PathCheck check =
      check_path(*bend(), path({{9, 4}, {9, 4}, {9, 6}, {9, 6}, {9, 9}, {9, 9}}));
  EXPECT_TRUE(check.is_free);
  EXPECT_NEAR(check.checked_m, 5.0, 1e-6);
}

TEST(PathQuery, HostilePathsGetAStatusAndAReason) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto expect = [view = bend()](const PathQuery& query, TraversabilityStatus status,
                                      const std::string& named) {
    const PathCheck check = check_path(*view, query);
    EXPECT_EQ(check.status, status) << named;
    EXPECT_FALSE(check.is_free);
    EXPECT_THAT(check.reason, HasSubstr(named));
  };
  using enum TraversabilityStatus;
  expect(path({}), invalid_request, "no poses");
  expect(path({{0, 0}}), invalid_request, "one position and no heading");
  expect(path({{0, 0}, {1, 0}}, {0.0}), invalid_request, "2 positions and 1 headings");
  expect(path({{0, 0}, {nan, 1}}), invalid_request, "position 1 is (nan, 1)");
  expect(path({{0, 0}, {1e9, 0}}), invalid_request, "within 100 km");
  expect(path({{0, 0}}, {nan}), invalid_request, "heading nan");
  expect(path(std::vector<Eigen::Vector2d>(1'000'000, Eigen::Vector2d::Zero())), too_large,
         "1000000 positions; at most 50000");
  expect(path({{0, 0}, {99'000, 0}, {0, 0}}), too_large, "ask for parts");
}

}  // namespace
}  // namespace stillmap
