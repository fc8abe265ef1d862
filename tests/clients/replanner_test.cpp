#include "clients/commands/planning/replanner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::VoxelWorld;
using ::testing::HasSubstr;

/// What a server would tell of the world since `before`.
RegionNews news_since(const MapView& before, const MapView& now) {
  RegionNews news;
  news.map = {now.version, now.map_id, now.tile_size_m, now.voxel_size_m};
  for (const auto& tile : now.tiles) {
    if (tile->info.revision > before.version) news.changed.push_back(*tile);
  }
  return news;
}

/// A road with two gaps in a wall, and a client that mirrors it.
class PlanRunTest : public testing::Test {
 protected:
  PlanRunTest() {
    world_.ground(0, 0, 40, 24, road);
    world_.block(20, 4, 20.6, 18, 0.3, 2.0, building);
    task_.profile = test::square_robot();
    task_.from = PlanPlace{{10, 5}, 0.0};
    task_.to = {{30, 5}, std::nullopt};
    task_.time_limit_s = 30.0;
  }

  const MapView& tell() {
    const MapView now = world_.view();
    mirror_.apply(news_since(*mirror_.view(), now));
    view_ = mirror_.view();
    return *view_;
  }

  VoxelWorld world_;
  TileMirror mirror_;
  std::shared_ptr<const MapView> view_;
  PlanTask task_;
};

TEST_F(PlanRunTest, ATileThatClosesTheGapMakesItTakeTheOther) {
  PlanRun run(task_);
  ASSERT_TRUE(run.plan(tell(), std::nullopt).plan.is_found()) << run.last().plan.reason;
  const double near_gap_m = run.last().plan.length_m;
  EXPECT_LT(near_gap_m, 26.0);
  EXPECT_FALSE(run.follow(tell(), std::nullopt));

  world_.block(20, 0, 20.6, 4, 0.3, 2.0, building);
  EXPECT_TRUE(run.follow(tell(), std::nullopt));
  EXPECT_THAT(run.last().cause, HasSubstr("not free any more"));
  ASSERT_TRUE(run.last().plan.is_found()) << run.last().plan.reason;
  EXPECT_GT(run.last().plan.length_m, near_gap_m + 8.0);
  EXPECT_TRUE(check_path(run.area(), run.last().plan.path_map()).is_free);

  world_.block(20, 18, 20.6, 24, 0.3, 2.0, building);
  EXPECT_TRUE(run.follow(tell(), std::nullopt));
  EXPECT_EQ(run.last().plan.status, PlanStatus::no_way);

  world_.clear(20, 2, 20.6, 6);
  world_.ground(20, 2, 20.6, 6, road);
  EXPECT_TRUE(run.follow(tell(), std::nullopt));
  EXPECT_TRUE(run.last().plan.is_found()) << run.last().plan.reason;
}

TEST_F(PlanRunTest, WithoutAStartItPlansFromWhereTheRobotIs) {
  task_.from.reset();
  PlanRun run(task_);
  const PlanPlace robot{{6, 12}, 0.5};
  const PathPlan& plan = run.plan(tell(), robot).plan;
  ASSERT_TRUE(plan.is_found()) << plan.reason;
  EXPECT_EQ(plan.poses.front().pose.position_map, robot.position_map);
}

}  // namespace
}  // namespace stillmap
