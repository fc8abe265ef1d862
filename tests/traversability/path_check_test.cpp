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

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A road 16 m square with a wall across it that has a gap of 2 m.
VoxelWorld walled_road() {
  VoxelWorld world;
  world.ground(-8, -8, 8, 8, road);
  world.block(0, -8, 0.2, -1, 0.3, 2.0, building);
  world.block(0, 1, 0.2, 8, 0.3, 2.0, building);
  return world;
}

PathCheck check(const TraversabilityView& view, const std::vector<PlanarPose>& path_map) {
  return check_path(view, path_map);
}

TEST(PathCheck, ThroughTheGapIsFreeWithTheClearanceThatIsLeft) {
  const auto view = traversability_of(walled_road().view(), square_robot());
  const PathCheck path = check(*view, {{{-4, 0}, 0}, {{4, 0}, 0}});
  ASSERT_EQ(path.status, TraversabilityStatus::ok);
  EXPECT_TRUE(path.is_free);
  EXPECT_NEAR(path.checked_m, 8.0, 1e-9);
  // Half the gap less half the width, to a cell.
  EXPECT_NEAR(path.clearance_m, 0.5, 0.21);
}

TEST(PathCheck, AgainstTheWallSaysWhereWhyAndHowFar) {
  const auto view = traversability_of(walled_road().view(), square_robot());
  const PathCheck path = check(*view, {{{-4, -4}, 0}, {{-2, -4}, 0}, {{4, -4}, 0}});
  ASSERT_TRUE(path.conflict);
  EXPECT_FALSE(path.is_free);
  EXPECT_EQ(path.conflict->reason, BlockReason::obstacle);
  EXPECT_EQ(path.conflict->segment, 1U);
  EXPECT_NEAR(path.conflict->cell_centre_map.x(), 0.1, 0.11);
  EXPECT_NEAR(path.conflict->cell_centre_map.y(), -4.0, 0.7);
  // The robot's front is half a metre ahead of it.
  EXPECT_NEAR(path.conflict->along_m, 3.5, 0.2);
  EXPECT_EQ(path.clearance_m, 0.0);
}

TEST(PathCheck, AThinWallBetweenTwoFarPosesIsNotJumpedOver) {
  const auto view = traversability_of(walled_road().view(), square_robot());
  EXPECT_FALSE(check(*view, {{{-6, 4}, 0}, {{6, 4}, 0}}).is_free);
}

TEST(PathCheck, TheOrientedFootprintDecides) {
  RobotProfile robot = square_robot();
  robot.length_m = 3.0;
  const auto view = traversability_of(walled_road().view(), robot);
  EXPECT_TRUE(check(*view, {{{0, 0}, 0}}).is_free);
  EXPECT_FALSE(check(*view, {{{0, 0}, std::numbers::pi / 2}}).is_free);
  // Turning on the spot sweeps the corners into the wall.
  EXPECT_FALSE(check(*view, {{{0, 0}, 0}, {{0, 0}, std::numbers::pi}}).is_free);
}

TEST(PathCheck, TheFootprintLiesAheadOfThePoseAsTheProfileSays) {
  RobotProfile robot = square_robot();
  robot.length_m = 3.0;
  robot.centre_ahead_m = 1.3;
  const auto view = traversability_of(walled_road().view(), robot);
  EXPECT_TRUE(check(*view, {{{1.0, -4}, 0}}).is_free);
  EXPECT_FALSE(check(*view, {{{1.0, -4}, std::numbers::pi}}).is_free);
}

TEST(PathCheck, UnknownGroundStopsThoseWhomItMust) {
  RobotProfile robot = square_robot();
  const MapSnapshot map = walled_road().view();
  const PathCheck stopped = check(*traversability_of(map, robot), {{{-4, 0}, 0}, {{-12, 0}, 0}});
  ASSERT_TRUE(stopped.conflict);
  EXPECT_EQ(stopped.conflict->reason, BlockReason::unknown);
  robot.unknown = UnknownGround::allowed;
  EXPECT_TRUE(check(*traversability_of(map, robot), {{{-4, 0}, 0}, {{-12, 0}, 0}}).is_free);
}

TEST(PathCheck, CountsTheWayOverInferredGround) {
  VoxelWorld world;
  world.ground(-8, -8, 8, 8, road);
  world.clear(0, -0.4, 1, 0.4);
  const auto view = traversability_of(world.view(), square_robot());
  const PathCheck path = check(*view, {{{-4, 0}, 0}, {{4, 0}, 0}});
  EXPECT_TRUE(path.is_free);
  EXPECT_NEAR(path.inferred_m, 2.0, 0.4);  // the hole and the robot's length
}

TEST(PathCheck, HostilePathsGetAStatusAndAReason) {
  const auto view = traversability_of(walled_road().view(), square_robot());
  const auto refused = [&](const std::vector<PlanarPose>& path_map, TraversabilityStatus status) {
    const PathCheck path = check(*view, path_map);
    EXPECT_EQ(path.status, status);
    EXPECT_FALSE(path.is_free);
    return path.reason;
  };
  using enum TraversabilityStatus;
  EXPECT_THAT(refused({}, invalid_request), HasSubstr("no poses"));
  EXPECT_THAT(refused({{{0, 0}, 0}, {{nan, 0}, 0}}, invalid_request), HasSubstr("pose 1"));
  EXPECT_THAT(refused({{{0, 0}, nan}}, invalid_request), HasSubstr("heading nan"));
  EXPECT_THAT(refused({{{1e9, 0}, 0}}, invalid_request), HasSubstr("100 km"));
  const std::vector<PlanarPose> endless{{{-9e4, 0}, 0}, {{9e4, 0}, 0}};
  EXPECT_THAT(refused(endless, too_large), HasSubstr("ask for parts"));
  std::vector<PlanarPose> spinning;
  for (int i = 0; i < 90'000; ++i) spinning.push_back({{0, 0}, 3.0 * i});
  EXPECT_THAT(refused(spinning, too_large), HasSubstr("turns too much"));
  EXPECT_THAT(refused(std::vector<PlanarPose>(max_path_poses + 1), too_large), HasSubstr("poses"));
}

TEST(PathCheck, OnAnEmptyMapIsNotFound) {
  const auto view = traversability_of(MapSnapshot{}, square_robot());
  EXPECT_EQ(check(*view, {{{0, 0}, 0}}).status, TraversabilityStatus::not_found);
}

}  // namespace
}  // namespace stillmap
