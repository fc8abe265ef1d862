#include "clients/commands/live/replay_poses.hpp"

#include <gtest/gtest.h>

namespace stillmap::cli {
namespace {

StampedPose pose(std::int64_t stamp_ns, double x_m) {
  StampedPose made;
  made.stamp_ns = stamp_ns;
  made.T_map_lidar = Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.0, 0.0));
  return made;
}

OdometryUpdate update(std::int64_t stamp_ns, double x_m) {
  OdometryUpdate made;
  made.pose = pose(stamp_ns, x_m);
  made.child_frame = "base_link";
  return made;
}

TEST(ReplayPosesTest, TakeFromThePathWhatTheOdometryTopicLost) {
  ReplayPoses poses;
  poses.begin();
  poses.take(update(1, 1.0));
  poses.take(Trajectory{pose(1, 5.0), pose(2, 2.0)});
  const Trajectory found = poses.poses_of({1, 2, 3});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].T_map_lidar.translation().x(), 1.0);
  EXPECT_EQ(found[1].stamp_ns, 2);
  EXPECT_EQ(poses.frame(), "base_link");
}

TEST(ReplayPosesTest, AreNotThoseOfAnEarlierReplayOfTheSameStamps) {
  ReplayPoses poses;
  const Trajectory path{pose(1, 1.0), pose(2, 2.0)};
  poses.take(path);
  poses.wait_for_path(std::chrono::milliseconds(0));
  poses.begin();
  EXPECT_TRUE(poses.poses_of({1, 2}).empty());
  // The path goes on; of the old stamps, it may still tell the old poses.
  poses.take(Trajectory{pose(1, 1.0), pose(2, 2.0), pose(3, 3.0)});
  EXPECT_EQ(poses.poses_of({1, 2, 3}).size(), 1U);
  poses.take(update(2, 9.0));
  const Trajectory found = poses.poses_of({1, 2, 3});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].T_map_lidar.translation().x(), 9.0);
}

}  // namespace
}  // namespace stillmap::cli
