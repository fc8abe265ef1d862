#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "idl/conversions/header.hpp"
#include "idl/conversions/pose.hpp"

namespace stillmap::wire {
namespace {

Eigen::Isometry3d some_pose() {
  return Eigen::Isometry3d(Eigen::Translation3d(1.5, -2.5, 0.25) *
                           Eigen::AngleAxisd(2.5, Eigen::Vector3d(0.2, -0.4, 0.9).normalized()));
}

TEST(Stamp, ComesBackOnBothSidesOfTheEpoch) {
  for (const std::int64_t stamp : {0L, 1L, 999'999'999L, 1'000'000'000L, -1L, -1'000'000'000L,
                                   -1'500'000'000L, 1'700'000'000'123'456'789L}) {
    EXPECT_EQ(stamp_ns(to_stamp(stamp)), stamp);
    EXPECT_LT(to_stamp(stamp).nanosec(), 1'000'000'000U);
  }
}

TEST(Odometry, ComesBackWithItsCovariance) {
  Eigen::Matrix<double, 6, 6> covariance;
  for (int i = 0; i < 36; ++i) covariance(i / 6, i % 6) = i;
  const StampedPose pose{.stamp_ns = 123'456'789'012, .T_map_lidar = some_pose()};
  const auto message = to_odometry(pose, covariance, "map", "lidar");
  EXPECT_EQ(message.header().frame_id(), "map");
  EXPECT_EQ(message.child_frame_id(), "lidar");
  // ROS 2 wants it by rows.
  EXPECT_EQ(message.pose().covariance()[1], 1.0);
  const auto back = from_odometry(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->pose.stamp_ns, pose.stamp_ns);
  EXPECT_TRUE(back->pose.T_map_lidar.isApprox(pose.T_map_lidar, 1e-12));
  EXPECT_EQ(back->covariance, covariance);
}

TEST(Odometry, HasAVelocityWhereOneIsGiven) {
  Eigen::Matrix<double, 6, 1> velocity;
  velocity << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0;
  const auto message = to_odometry({.stamp_ns = 1}, Eigen::Matrix<double, 6, 6>::Zero(), "odom",
                                   "base_link", velocity);
  EXPECT_EQ(message.twist().twist().linear().y(), 2.0);
  EXPECT_EQ(message.twist().twist().angular().z(), 6.0);
}

TEST(Odometry, IsRefusedWhenItIsNoPose) {
  const auto message = to_odometry({.stamp_ns = 1}, Eigen::Matrix<double, 6, 6>::Zero(), "a", "b");
  auto nan = message;
  nan.pose().pose().position().x(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(from_odometry(nan));
  auto no_rotation = message;
  no_rotation.pose().pose().orientation().w(0.0);
  EXPECT_FALSE(from_odometry(no_rotation));
  auto bad_stamp = message;
  bad_stamp.header().stamp().nanosec(2'000'000'000);
  EXPECT_FALSE(from_odometry(bad_stamp));
}

TEST(Tf, SaysWhereTheLidarIsInTheMap) {
  const auto message = to_tf(7, {{"map", "lidar", some_pose()}});
  ASSERT_EQ(message.transforms().size(), 1U);
  const auto& transform = message.transforms().front();
  EXPECT_EQ(transform.header().frame_id(), "map");
  EXPECT_EQ(transform.child_frame_id(), "lidar");
  EXPECT_EQ(transform.transform().translation().y(), -2.5);
  const Eigen::Quaterniond expected(some_pose().rotation());
  EXPECT_NEAR(transform.transform().rotation().w(), expected.w(), 1e-12);
}

TEST(Tf, ComesBackWithoutUnusableTransforms) {
  auto message = to_tf(7, {{"base_link", "lidar", some_pose()}, {"base_link", "imu", some_pose()}});
  message.transforms()[1].transform().rotation() = {};
  const std::vector<FrameTransform> back = from_tf(message);
  ASSERT_EQ(back.size(), 1U);
  EXPECT_EQ(back[0].parent, "base_link");
  EXPECT_EQ(back[0].child, "lidar");
  EXPECT_TRUE(back[0].T_parent_child.isApprox(some_pose(), 1e-12));
}

TEST(Path, ComesBackInOrderWithoutUnusablePoses) {
  const Trajectory trajectory = {
      {.stamp_ns = 10}, {.stamp_ns = 20, .T_map_lidar = some_pose()}, {.stamp_ns = 30}};
  auto message = to_path(trajectory, "map");
  message.poses()[2].pose().position().z(std::numeric_limits<double>::infinity());
  const Trajectory back = from_path(message);
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[1].stamp_ns, 20);
  EXPECT_TRUE(back[1].T_map_lidar.isApprox(some_pose(), 1e-12));
}

}  // namespace
}  // namespace stillmap::wire
