#include "clients/commands/planning/replanner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap::cli {
namespace {

using enum SemanticClass;
using test::VoxelWorld;
using ::testing::HasSubstr;

/// What a server would tell of the world since `before`.
RegionUpdate update_since(const MapSnapshot& before, const MapSnapshot& now) {
  RegionUpdate update;
  update.map = {now.version, now.map_id, now.tile_size_m, now.voxel_size_m};
  for (const auto& tile : now.tiles) {
    if (tile->info.revision > before.version) update.changed.push_back(*tile);
  }
  return update;
}

/// A road with two gaps in a wall, and a client that mirrors it.
class ReplannerTest : public testing::Test {
 protected:
  ReplannerTest() {
    world_.ground(0, 0, 40, 24, road);
    world_.block(20, 4, 20.6, 18, 0.3, 2.0, building);
    task_.profile = test::square_robot();
    task_.from = Goal{{10, 5}, 0.0};
    task_.to = {{30, 5}, std::nullopt};
    task_.time_limit_s = 30.0;
  }

  const MapSnapshot& update_mirror() {
    const MapSnapshot now = world_.view();
    mirror_.apply(update_since(*mirror_.snapshot(), now));
    view_ = mirror_.snapshot();
    return *view_;
  }

  VoxelWorld world_;
  TileMirror mirror_;
  std::shared_ptr<const MapSnapshot> view_;
  PlanTask task_;
};

TEST_F(ReplannerTest, ATileThatClosesTheGapMakesItTakeTheOther) {
  Replanner replanner(task_);
  ASSERT_TRUE(replanner.plan(update_mirror(), std::nullopt).plan.is_found())
      << replanner.last().plan.reason;
  const double near_gap_m = replanner.last().plan.length_m;
  EXPECT_LT(near_gap_m, 26.0);
  EXPECT_FALSE(replanner.replan_if_needed(update_mirror(), std::nullopt));

  world_.block(20, 0, 20.6, 4, 0.3, 2.0, building);
  EXPECT_TRUE(replanner.replan_if_needed(update_mirror(), std::nullopt));
  EXPECT_THAT(replanner.last().cause, HasSubstr("not free any more"));
  ASSERT_TRUE(replanner.last().plan.is_found()) << replanner.last().plan.reason;
  EXPECT_GT(replanner.last().plan.length_m, near_gap_m + 8.0);
  EXPECT_TRUE(check_path(replanner.traversability(), replanner.last().plan.path_map()).is_free);

  world_.block(20, 18, 20.6, 24, 0.3, 2.0, building);
  EXPECT_TRUE(replanner.replan_if_needed(update_mirror(), std::nullopt));
  EXPECT_EQ(replanner.last().plan.status, PlanStatus::no_path);

  world_.clear(20, 2, 20.6, 6);
  world_.ground(20, 2, 20.6, 6, road);
  EXPECT_TRUE(replanner.replan_if_needed(update_mirror(), std::nullopt));
  EXPECT_TRUE(replanner.last().plan.is_found()) << replanner.last().plan.reason;
}

TEST_F(ReplannerTest, WithoutAStartItPlansFromWhereTheRobotIs) {
  task_.from.reset();
  Replanner replanner(task_);
  const Goal robot{{6, 12}, 0.5};
  const PathPlan& plan = replanner.plan(update_mirror(), robot).plan;
  ASSERT_TRUE(plan.is_found()) << plan.reason;
  EXPECT_EQ(plan.poses.front().pose.position_map, robot.position_map);
}

}  // namespace
}  // namespace stillmap::cli
