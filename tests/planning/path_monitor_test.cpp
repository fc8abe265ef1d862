#include "core/planning/path_monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/planning/path_planner.hpp"
#include "core/traversability/traversability_map.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::VoxelWorld;
using ::testing::HasSubstr;

/// A road of 60 by 60 m; a path along its lower side.
class PathMonitorTest : public testing::Test {
 protected:
  PathMonitorTest() : area_({square_robot()}) {
    world_.ground(0, 0, 60, 60, road);
    plan_ = plan_path(current(), {{5, 5}, 0.0}, {{55, 5}, 0.0});
    monitor_.emplace(current(), plan_);
  }

  [[nodiscard]] const TraversabilityView& current() {
    (void)area_.update(world_.view());
    view_ = area_.view("square");
    return *view_;
  }

  VoxelWorld world_;
  TraversabilityMap area_;
  std::shared_ptr<const TraversabilityView> view_;
  PathPlan plan_;
  std::optional<PathMonitor> monitor_;
};

TEST_F(PathMonitorTest, NoChangeIsNoReason) {
  ASSERT_TRUE(plan_.is_found());
  EXPECT_FALSE(monitor_->update(current()));
}

TEST_F(PathMonitorTest, AnObstacleOnThePathIsAConflictWithItsCell) {
  world_.block(30, 2, 31, 8, 0.3, 2.0, building);
  const auto cause = monitor_->update(current());
  ASSERT_TRUE(cause);
  ASSERT_TRUE(cause->conflict);
  EXPECT_NEAR(cause->conflict->cell_centre_map.x(), 30.0, 0.5);
  EXPECT_THAT(cause->reason, HasSubstr("not free any more: obstacle"));
}

TEST_F(PathMonitorTest, AChangeBesideThePathIsAReasonWithoutAConflict) {
  world_.block(30, 7, 31, 7.6, 0.3, 2.0, building);
  const auto cause = monitor_->update(current());
  ASSERT_TRUE(cause);
  EXPECT_FALSE(cause->conflict);
  EXPECT_THAT(cause->reason, HasSubstr("on the path changed"));
  EXPECT_FALSE(monitor_->update(current()));
}

TEST_F(PathMonitorTest, AChangeElsewhereIsNoReason) {
  world_.block(30, 50, 31, 52, 0.3, 2.0, building);
  EXPECT_FALSE(monitor_->update(current()));
}

TEST_F(PathMonitorTest, GroundRemovedOnThePathIsAConflict) {
  world_.clear(20, 0, 32, 20);
  const auto cause = monitor_->update(current());
  ASSERT_TRUE(cause && cause->conflict);
  EXPECT_EQ(cause->conflict->reason, BlockReason::unknown);
}

TEST_F(PathMonitorTest, AnotherMapAndAFailedPlanAreReasons) {
  PathMonitor failed(current(), plan_path(current(), {{5, 5}, {}}, {{90, 5}, {}}));
  EXPECT_FALSE(failed.update(current()));
  world_.ground(60, 0, 100, 60, road);
  EXPECT_TRUE(failed.update(current()));
  MapSnapshot other = world_.view();
  other.map_id = 7;
  (void)area_.update(other);
  const auto cause = monitor_->update(*area_.view("square"));
  ASSERT_TRUE(cause);
  EXPECT_THAT(cause->reason, HasSubstr("another map"));
}

}  // namespace
}  // namespace stillmap
