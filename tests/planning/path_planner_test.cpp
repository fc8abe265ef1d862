#include "core/planning/path_planner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/planning/planning_grid.hpp"
#include "tests/numbers.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

using test::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Two lanes of 5 m, 60 m long, with a wall between them that ends 10 m before their end.
VoxelWorld two_lanes() {
  VoxelWorld world;
  world.ground(0, -6, 60, 6, road);
  world.block(0, -0.6, 46, 0.6, 0.3, 2.0, building);
  return world;
}

RobotProfile small_car() {
  RobotProfile robot = square_robot();
  robot.name = "small_car";
  robot.length_m = 4.0;
  robot.width_m = 1.8;
  robot.min_turning_radius_m = 4.0;
  return robot;
}

void expect_drivable(const TraversabilityView& view, const PathPlan& plan) {
  ASSERT_EQ(plan.status, PlanStatus::found) << plan.reason;
  EXPECT_TRUE(check_path(view, plan.path_map()).is_free);
  const double radius_m = view.profile.min_turning_radius_m;
  for (std::size_t i = 1; i < plan.poses.size() && radius_m > 0.0; ++i) {
    const double turned = std::remainder(
        plan.poses[i].pose.heading_rad - plan.poses[i - 1].pose.heading_rad, 2.0 * pi);
    const double driven_m = plan.poses[i].along_m - plan.poses[i - 1].along_m;
    EXPECT_LE(std::abs(turned), driven_m / radius_m + 1e-6);
  }
}

TEST(PathPlanner, ACarTurnsRoundTheEndOfTheWall) {
  const auto view = traversability_of(two_lanes().view(), small_car());
  const PathPlan plan = plan_path(*view, {{5, -3}, 0.0}, {{5, 3}, pi});
  expect_drivable(*view, plan);
  EXPECT_EQ(plan.poses.front().pose.position_map, Eigen::Vector2d(5, -3));
  EXPECT_EQ(plan.poses.back().pose.position_map, Eigen::Vector2d(5, 3));
  EXPECT_NEAR(std::cos(plan.poses.back().pose.heading_rad), -1.0, 1e-9);
  EXPECT_GT(plan.length_m, 82.0);
  EXPECT_LT(plan.length_m, 110.0);
  EXPECT_GE(plan.cost, plan.length_m - 1e-6);
  EXPECT_NEAR(plan.poses.back().along_m, plan.length_m, 1e-9);
  EXPECT_NEAR(plan.poses.front().height_m, 0.1, 0.05);
}

TEST(PathPlanner, PlansInAMapThatIsLargerThanCanBeSearched) {
  VoxelWorld world = two_lanes();
  world.ground(2000, 2000, 2010, 2010, road);
  const auto view = traversability_of(world.view(), small_car());
  ASSERT_GT(view->bounds_map().volume() / (view->cell_m * view->cell_m), PlanningGrid::max_cells);
  expect_drivable(*view, plan_path(*view, {{5, -3}, 0.0}, {{5, 3}, pi}));
  const PathPlan none = plan_path(*view, {{5, -3}, 0.0}, {{2005, 2005}, 0.0});
  EXPECT_EQ(none.status, PlanStatus::invalid_request);
  EXPECT_THAT(none.reason, HasSubstr("goal on the way"));
}

TEST(PathPlanner, EveryPlannerFindsAPath) {
  const auto view = traversability_of(two_lanes().view(), square_robot());
  for (std::size_t i = 0; i < planner_kind_count; ++i) {
    PlanningConfig config;
    config.planner = static_cast<PlannerKind>(i);
    config.max_steps = 200'000;
    bool has_path = false;
    config.improved = [&](double) { has_path = true; };
    config.should_stop = [&] { return has_path; };
    const PathPlan plan = plan_path(*view, {{30, -3}, std::nullopt}, {{30, 3}, {}}, config);
    EXPECT_EQ(plan.status, PlanStatus::found) << name(config.planner) << ": " << plan.reason;
    expect_drivable(*view, plan);
  }
}

TEST(PathPlanner, TheSameSeedGivesTheSamePath) {
  const auto view = traversability_of(two_lanes().view(), small_car());
  const auto plan = [&](std::uint32_t seed) {
    PlanningConfig config;
    config.seed = seed;
    return plan_path(*view, {{5, -3}, 0.0}, {{5, 3}, pi}, config);
  };
  const PathPlan first = plan(3);
  const PathPlan again = plan(3);
  ASSERT_EQ(first.poses.size(), again.poses.size());
  EXPECT_EQ(first.cost, again.cost);
  EXPECT_NE(first.cost, plan(4).cost);
}

TEST(PathPlanner, ABlockedStartOrGoalHasAConflictAndTheNearestFreeCell) {
  VoxelWorld world = two_lanes();
  const auto view = traversability_of(world.view(), square_robot());
  const PathPlan on_wall = plan_path(*view, {{30, 0}, {}}, {{30, 3}, {}});
  EXPECT_EQ(on_wall.status, PlanStatus::start_blocked);
  ASSERT_TRUE(on_wall.conflict);
  EXPECT_EQ(on_wall.conflict->reason, BlockReason::obstacle);
  ASSERT_TRUE(on_wall.nearby);
  EXPECT_LT(on_wall.nearby->distance_m, 2.5);
  EXPECT_THAT(on_wall.reason,
              AllOf(HasSubstr("obstacle"), ContainsRegex(", [0-9]+([.][0-9])? m away")));
  const PathPlan to_unknown = plan_path(*view, {{30, 3}, {}}, {{30, 20}, {}});
  EXPECT_EQ(to_unknown.status, PlanStatus::goal_blocked);
  EXPECT_THAT(to_unknown.reason, HasSubstr("unknown"));
}

TEST(PathPlanner, WithoutACoarseRouteThereIsNoSearch) {
  VoxelWorld world = two_lanes();
  world.block(40, -6, 41, 6, 0.3, 2.0, building);
  const auto view = traversability_of(world.view(), square_robot());
  const PathPlan plan = plan_path(*view, {{30, -3}, {}}, {{50, -3}, {}});
  EXPECT_EQ(plan.status, PlanStatus::no_path);
  EXPECT_EQ(plan.steps, 0U);
  EXPECT_TRUE(plan.poses.empty());
}

TEST(PathPlanner, DrivesOnUnknownGroundOnlyIfAllowed) {
  VoxelWorld world = two_lanes();
  world.clear(46, -6, 60, 6);
  RobotProfile robot = square_robot();
  const MapSnapshot map = world.view();
  EXPECT_EQ(plan_path(*traversability_of(map, robot), {{30, -3}, {}}, {{30, 3}, {}}).status,
            PlanStatus::no_path);
  robot.unknown = UnknownGround::allowed;
  const auto view = traversability_of(map, robot);
  const PathPlan plan = plan_path(*view, {{30, -3}, {}}, {{30, 3}, {}});
  expect_drivable(*view, plan);
  // Also to a place that no tile covers.
  expect_drivable(*view, plan_path(*view, {{30, -3}, {}}, {{80, -3}, {}}));
}

TEST(PathPlanner, OnUnknownGroundTheHeightIsUnknown) {
  VoxelWorld world = two_lanes();
  world.clear(46, -6, 60, 6);
  RobotProfile robot = square_robot();
  robot.unknown = UnknownGround::allowed;
  const auto view = traversability_of(world.view(), robot);
  const PathPlan plan = plan_path(*view, {{30, -3}, {}}, {{80, -3}, {}});
  ASSERT_TRUE(plan.is_found()) << plan.reason;
  EXPECT_NEAR(plan.poses.front().height_m, 0.1, 1e-3);
  EXPECT_TRUE(std::isnan(plan.poses.back().height_m));
}

TEST(PathPlanner, ARobotOnABridgeIsNotPlannedForOnTheGroundBelow) {
  VoxelWorld world;
  world.ground(-10, -10, 10, 10, road);
  world.block(-10, -2, 10, 2, 5.1, 5.2, road);
  const auto view = traversability_of(world.view(), square_robot());
  const Goal to{{0, 6}, {}};
  const PathPlan on_deck = plan_path(*view, {{0, 0}, {}, 5.9}, to);
  EXPECT_EQ(on_deck.status, PlanStatus::start_blocked);
  EXPECT_THAT(on_deck.reason, HasSubstr("5.8 m below"));
  EXPECT_EQ(plan_path(*view, {{0, 0}, {}, -3.0}, to).status, PlanStatus::start_blocked);
  EXPECT_TRUE(plan_path(*view, {{0, 0}, {}, 0.9}, to).is_found());
  EXPECT_TRUE(plan_path(*view, {{0, 0}, {}}, to).is_found());
}

TEST(PathPlanner, AtTheGoalThePathIsOnePose) {
  const auto view = traversability_of(two_lanes().view(), small_car());
  const PathPlan plan = plan_path(*view, {{30, -3}, 0.0}, {{30, -3}, {}});
  EXPECT_EQ(plan.status, PlanStatus::found);
  EXPECT_EQ(plan.poses.size(), 1U);
  EXPECT_EQ(plan.length_m, 0.0);
  // But to face the other way, a car has to turn.
  const PathPlan turned = plan_path(*view, {{52, 0}, 0.0}, {{52, 0}, pi});
  expect_drivable(*view, turned);
  EXPECT_GT(turned.length_m, pi * 4.0 * 0.9);
}

TEST(PathPlanner, StoppedEarlyItIsOutOfTime) {
  const auto view = traversability_of(two_lanes().view(), small_car());
  PlanningConfig config;
  config.should_stop = [] { return true; };
  const PathPlan plan = plan_path(*view, {{5, -3}, 0.0}, {{5, 3}, pi}, config);
  EXPECT_EQ(plan.status, PlanStatus::out_of_time);
  EXPECT_THAT(plan.reason, HasSubstr("allow more"));
}

TEST(PathPlanner, InvalidRequestsGetAReason) {
  const auto view = traversability_of(two_lanes().view(), square_robot());
  const auto reason = [&](const Goal& from, const Goal& to) {
    const PathPlan plan = plan_path(*view, from, to);
    EXPECT_EQ(plan.status, PlanStatus::invalid_request);
    EXPECT_TRUE(plan.poses.empty());
    return plan.reason;
  };
  EXPECT_THAT(reason({{nan, 0}, {}}, {{30, 3}, {}}), HasSubstr("start: position"));
  EXPECT_THAT(reason({{30, 3}, {}}, {{1e9, 0}, {}}), HasSubstr("goal: position"));
  EXPECT_THAT(reason({{30, 3}, nan}, {{30, -3}, {}}), HasSubstr("heading nan"));
  EXPECT_THAT(reason({{30, 3}, {}}, {{9e4, 9e4}, {}}), HasSubstr("cells"));
  const auto nothing = traversability_of(MapSnapshot{}, square_robot());
  EXPECT_EQ(plan_path(*nothing, {{0, 0}, {}}, {{1, 1}, {}}).status, PlanStatus::no_path);
}

TEST(PathPlanner, RefusesAConfigurationWithFaults) {
  const auto view = traversability_of(two_lanes().view(), square_robot());
  PlanningConfig config;
  config.reverse_factor = 0.5;
  config.cost_weight = nan;
  config.seed = 0;
  try {
    (void)plan_path(*view, {{30, 3}, {}}, {{40, 3}, {}}, config);
    FAIL();
  } catch (const std::invalid_argument& error) {
    for (const char* field : {"reverse_factor", "cost_weight", "seed"}) {
      EXPECT_THAT(error.what(), HasSubstr(field));
    }
  }
}

/// Free ground without a tile's surface to compute: from (0, 0), by whole tiles of 100 cells.
TraversabilityView free_ground(const RobotProfile& robot, double cell_m, int columns, int rows) {
  constexpr int side = 100;
  auto surface = std::make_shared<SurfaceTile>();
  surface->side = side;
  surface->cells.resize(side * side);
  for (SurfaceCell& cell : surface->cells) cell.ground.origin = GroundOrigin::seen;
  surface->begin.assign(side * side + 1, 0);
  TraversabilityCell free;
  free.state = CellState::free;
  free.clearance_m = static_cast<float>(clearance_limit_m(robot));
  TraversabilityView view;
  view.version = view.map_id = 1;
  view.cell_m = cell_m;
  view.tile_size_m = side * cell_m;
  view.profile = robot;
  for (int x = 0; x < columns; ++x) {
    for (int y = 0; y < rows; ++y) {
      const TraversabilityTile tile{{x, y}, 1, side, {side * side, free}, surface};
      view.tiles.push_back(std::make_shared<const TraversabilityTile>(tile));
    }
  }
  return view;
}

TEST(PathPlanner, APathThatIsTooLongForOneCheckIsFound) {
  RobotProfile robot = square_robot();
  robot.length_m = robot.width_m = 14.0;
  const TraversabilityView view = free_ground(robot, 0.1, 18, 6);
  const PathPlan plan = plan_path(view, {{20, 30}, 0.0}, {{160, 30}, 0.0});
  EXPECT_EQ(plan.status, PlanStatus::found) << plan.reason;
  EXPECT_NEAR(plan.length_m, 140.0, 1.0);
  EXPECT_GT(plan.clearance_m, 0.0);
  EXPECT_EQ(check_path(view, plan.path_map()).status, TraversabilityStatus::too_large);
}

TEST(PathPlanner, IsStoppedInEveryStageAndNamesIt) {
  const TraversabilityView view = free_ground(square_robot(), 0.2, 30, 30);
  std::uint64_t polls = 0;
  const auto plan_until = [&](std::uint64_t last) {
    PlanningConfig config;
    config.smoothing_attempts = 10;
    config.should_stop = [&, last] { return ++polls > last; };
    polls = 0;
    return plan_path(view, {{5, 5}, 0.0}, {{590, 590}, 0.0}, config);
  };
  ASSERT_TRUE(plan_until(10'000'000).is_found());
  for (const auto& [last, stage] : {std::pair{1, "grid of the map's cells"},
                                    {899, "grid of the map's cells"},
                                    {905, "grid of the map's cells"},
                                    {1000, "coarse route"},
                                    {3900, "coarse route"}}) {
    const PathPlan plan = plan_until(static_cast<std::uint64_t>(last));
    EXPECT_EQ(plan.status, PlanStatus::out_of_time) << last;
    EXPECT_THAT(plan.reason, HasSubstr(stage)) << last;
    EXPECT_LE(polls, static_cast<std::uint64_t>(last) + 1);
    EXPECT_TRUE(plan.poses.empty());
  }
}

}  // namespace
}  // namespace stillmap
