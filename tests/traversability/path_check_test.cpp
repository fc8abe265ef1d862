#include "core/traversability/path_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "tests/numbers.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::HasSubstr;

using test::nan;

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

TEST(PathCheck, OffTheMapThereIsNothingToBeNearTo) {
  RobotProfile robot = square_robot();
  robot.unknown = UnknownGround::allowed;
  VoxelWorld world;
  world.ground(-8, -8, 8, 8, road);
  const auto view = traversability_of(world.view(), robot);
  const PathCheck path = check(*view, {{{0, 0}, 0}, {{20, 0}, 0}});
  EXPECT_TRUE(path.is_free);
  EXPECT_EQ(path.clearance_m, clearance_limit_m(robot));
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

TEST(PathQuery, AConflictInATurnIsAtThePositionOfTheTurn) {
  // Along the wall there is room, but not for the robot's corners.
  const auto view = traversability_of(walled_road().view(), square_robot());
  const PathCheck check = check_path(*view, path({{-0.65, -6}, {-0.65, -4}, {-4, -4}}));
  ASSERT_TRUE(check.conflict);
  EXPECT_NEAR(check.conflict->along_m, 2.0, 1e-6);
  EXPECT_EQ(check.conflict->segment, 1U);
}

TEST(PathQuery, WaysOfNoLengthKeepTheHeading) {
  const PathCheck check =
      check_path(*bend(), path({{9, 4}, {9, 4}, {9, 6}, {9, 6}, {9, 9}, {9, 9}}));
  EXPECT_TRUE(check.is_free);
  EXPECT_NEAR(check.checked_m, 5.0, 1e-6);
}

TEST(PathQuery, HostilePathsGetAStatusAndAReason) {
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

double area_m2(const std::vector<Eigen::AlignedBox2d>& boxes) {
  double area = 0.0;
  for (const Eigen::AlignedBox2d& box : boxes) area += box.volume();
  return area;
}

TEST(PathBoxes, HoldWhatIsWithinReachOfALongBentPathAndLittleElse) {
  const std::vector<Eigen::Vector2d> bent{{0, 0}, {1000, 0}, {1003, 4}, {1003, 700}};
  const auto boxes = boxes_along(bent, 10.0);
  EXPECT_LT(area_m2(boxes), 1700.0 * 100.0);
  for (std::size_t i = 1; i < bent.size(); ++i) {
    for (double part = 0.0; part <= 1.0; part += 0.001) {
      const Eigen::Vector2d on_path = bent[i - 1] + part * (bent[i] - bent[i - 1]);
      const Eigen::AlignedBox2d robot(on_path.array() - 9.99, on_path.array() + 9.99);
      const auto holds = [&](const Eigen::AlignedBox2d& box) { return box.contains(robot); };
      EXPECT_TRUE(std::ranges::any_of(boxes, holds)) << on_path.transpose();
    }
  }
}

TEST(PathBoxes, AreFewForAPathOfManyPositionsAndForOnesOfNoEnd) {
  EXPECT_EQ(boxes_along(std::vector<Eigen::Vector2d>(100'000, {5, 5}), 10.0).size(), 1U);
  EXPECT_EQ(boxes_along({}, 10.0).size(), 1U);
  EXPECT_EQ(boxes_along(std::vector<Eigen::Vector2d>{{nan, 0}, {0, test::infinity}}, 10.0).size(),
            1U);
  std::vector<Eigen::Vector2d> endless;
  for (int i = 0; i < 1000; ++i) endless.emplace_back(i % 2 == 0 ? -1e300 : 1e300, 1.7e308);
  EXPECT_LE(boxes_along(endless, 10.0).size(), 10'000U);
}

TEST(PathCheck, ADropBehindUnknownGroundIsInConflictWhereThatMayBeDriven) {
  RobotProfile robot = square_robot();
  robot.unknown = UnknownGround::allowed;
  for (const double gap_m : {0.4, 1.0, 2.0}) {
    VoxelWorld world;
    world.ground(-8, -8, 0, 8, road, [](double, double) { return 1.3; });
    world.ground(gap_m, -8, 8, 8, road);
    const auto view = traversability_of(world.view(), robot);
    const PathCheck path = check(*view, {{{-5, 0}, 0}, {{6, 0}, 0}});
    ASSERT_TRUE(path.conflict) << gap_m;
    EXPECT_EQ(path.conflict->reason, BlockReason::step);
  }
}

}  // namespace

}  // namespace stillmap
