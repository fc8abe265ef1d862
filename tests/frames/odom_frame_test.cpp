#include "core/frames/odom_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/frames/rigid_motion.hpp"

namespace stillmap {
namespace {

using enum OdometryHealth;

constexpr std::int64_t period_ns = 100'000'000;

/// 1 m a scan, in a wide curve.
Eigen::Isometry3d on_road(int scan) {
  const double heading = 0.05 * scan;
  return from_xyz_rpy({20.0 * std::sin(heading), 20.0 * (1.0 - std::cos(heading)), 0.0},
                      {0.0, 0.0, heading});
}

/// Drives `scans` scans from the start of the map, the first one as it begins a map.
OdomFrame driven(int scans) {
  OdomFrame frame;
  for (int i = 0; i < scans; ++i) {
    (void)frame.update(i * period_ns, on_road(i), i == 0 ? initialised : good);
  }
  return frame;
}

double distance_m(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.translation() - b.translation()).norm();
}

TEST(OdomFrame, IsTheMapWhileNothingIsCorrected) {
  OdomFrame frame;
  for (int i = 0; i < 50; ++i) {
    const OdomPose pose = frame.update(i * period_ns, on_road(i), i == 0 ? initialised : good);
    EXPECT_TRUE(pose.T_odom_base.isApprox(on_road(i), 1e-9)) << i;
    EXPECT_TRUE(pose.T_map_odom.isApprox(Eigen::Isometry3d::Identity(), 1e-9)) << i;
  }
}

TEST(OdomFrame, HasAVelocityAlongTheRobotsAxes) {
  OdomFrame frame = driven(20);
  const OdomPose pose = frame.update(20 * period_ns, on_road(20), good);
  EXPECT_NEAR(pose.velocity[0], 10.0, 0.01);
  EXPECT_NEAR(pose.velocity[1], 0.0, 0.01);
  EXPECT_NEAR(pose.velocity[5], 0.5, 0.001);
}

TEST(OdomFrame, GoesOnSmoothlyWhereTheLostRobotIsFoundElsewhere) {
  OdomFrame frame = driven(20);
  const Eigen::Isometry3d elsewhere = from_xyz_rpy({3.0, -4.0, 0.2}, {0.0, 0.0, 1.0});
  Eigen::Isometry3d T_odom_before = on_road(19);
  for (int i = 20; i < 40; ++i) {
    const bool is_lost = i < 25;
    const Eigen::Isometry3d T_map_base = is_lost ? on_road(19) : elsewhere * on_road(i);
    const OdomPose pose = frame.update(i * period_ns, T_map_base, is_lost ? lost : good);
    EXPECT_NEAR(distance_m(pose.T_odom_base, T_odom_before), 1.0, 0.01) << i;
    EXPECT_TRUE((pose.T_map_odom * pose.T_odom_base).isApprox(T_map_base, 1e-9)) << i;
    T_odom_before = pose.T_odom_base;
  }
}

TEST(OdomFrame, FollowsThePriorWhileLost) {
  OdomFrame frame = driven(20);
  const Eigen::Isometry3d motion = from_xyz_rpy({0.8, 0.0, 0.0}, {0.0, 0.0, 0.02});
  const OdomPose pose = frame.update(20 * period_ns, on_road(19), lost, motion);
  EXPECT_TRUE(pose.T_odom_base.isApprox(on_road(19) * motion, 1e-9));
}

// Wheels that set themselves to the origin.
TEST(OdomFrame, DoesNotJumpWithThePriorWhileLost) {
  OdomFrame frame = driven(20);
  const Eigen::Isometry3d jump = from_xyz_rpy({-12.5, 0.0, 0.0}, {0.0, 0.0, 0.3});
  const OdomPose pose = frame.update(20 * period_ns, on_road(19), lost, jump);
  EXPECT_NEAR(distance_m(pose.T_odom_base, on_road(20)), 0.0, 0.2);
  const Eigen::Isometry3d motion = from_xyz_rpy({1.0, 0.0, 0.0}, {0.0, 0.0, 0.0});
  const OdomPose next = frame.update(21 * period_ns, on_road(19), lost, motion);
  EXPECT_TRUE(next.T_odom_base.isApprox(pose.T_odom_base * motion, 1e-6));
}

TEST(OdomFrame, StandsStillInALongGapWithoutAPose) {
  OdomFrame frame = driven(20);
  const OdomPose pose = frame.update(19 * period_ns + 60'000'000'000, on_road(19), lost);
  EXPECT_NEAR(distance_m(pose.T_odom_base, on_road(19)), 10.0, 0.2);
}

// A lidar that is covered, on a robot that has stopped meanwhile.
TEST(OdomFrame, StandsStillAfterASecondOfLostScans) {
  OdomFrame frame = driven(20);
  OdomPose pose;
  for (int i = 20; i < 120; ++i) pose = frame.update(i * period_ns, on_road(19), lost);
  EXPECT_NEAR(distance_m(pose.T_odom_base, on_road(19)), 10.0, 0.2);
  EXPECT_EQ(pose.velocity.norm(), 0.0);
  // Found where it stands, and driving on.
  for (int i = 120; i < 123; ++i) {
    const Eigen::Isometry3d before = pose.T_odom_base;
    pose = frame.update(i * period_ns, on_road(19), good);
    EXPECT_NEAR(distance_m(pose.T_odom_base, before), 0.0, 1e-9);
  }
  for (int i = 123; i < 130; ++i) pose = frame.update(i * period_ns, on_road(19 + i - 122), good);
  EXPECT_NEAR(pose.velocity[0], 10.0, 0.01);
}

TEST(OdomFrame, DoesNotJumpWithAnotherMap) {
  OdomFrame frame = driven(20);
  frame.begin_map();
  const OdomPose first = frame.update(20 * period_ns, Eigen::Isometry3d::Identity(), initialised);
  EXPECT_TRUE(first.T_odom_base.isApprox(on_road(20), 1e-6));
  EXPECT_TRUE((first.T_map_odom * first.T_odom_base).isApprox(Eigen::Isometry3d::Identity(), 1e-9));
  const Eigen::Isometry3d next = on_road(20).inverse() * on_road(21);
  EXPECT_TRUE(frame.update(21 * period_ns, next, good).T_odom_base.isApprox(on_road(21), 1e-6));
}

TEST(OdomFrame, DoesNotMoveWhenTheMapIsCorrected) {
  OdomFrame frame = driven(20);
  const Eigen::Isometry3d T_new_old = from_xyz_rpy({0.6, -0.4, 0.1}, {0.0, 0.0, 0.01});
  frame.correct_map(T_new_old);
  const OdomPose pose = frame.update(20 * period_ns, T_new_old * on_road(20), good);
  EXPECT_TRUE(pose.T_odom_base.isApprox(on_road(20), 1e-9));
  EXPECT_TRUE(pose.T_map_odom.isApprox(T_new_old, 1e-9));
}

TEST(OdomFrame, DoesNotJumpWithOneWrongPose) {
  OdomFrame frame = driven(20);
  const Eigen::Isometry3d aside = Eigen::Translation3d(0.0, 4.0, 0.0) * on_road(20);
  EXPECT_LT(distance_m(frame.update(20 * period_ns, aside, good).T_odom_base, on_road(20)), 0.01);
  EXPECT_LT(distance_m(frame.update(21 * period_ns, on_road(21), good).T_odom_base, on_road(21)),
            0.01);
  const OdomPose pose = frame.update(22 * period_ns, on_road(22), good);
  EXPECT_LT(distance_m(pose.T_odom_base, on_road(22)), 0.01);
}

TEST(OdomFrame, BelievesAMotionThatGoesOn) {
  OdomFrame frame = driven(20);
  // Stops within one scan, as against a wall.
  (void)frame.update(20 * period_ns, on_road(19), good);
  const Eigen::Isometry3d T_odom = frame.update(21 * period_ns, on_road(19), good).T_odom_base;
  for (int i = 22; i < 30; ++i) {
    EXPECT_TRUE(frame.update(i * period_ns, on_road(19), good).T_odom_base.isApprox(T_odom, 1e-9));
  }
}

TEST(OdomFrame, BearsClocksThatStandOrGoBack) {
  OdomFrame frame = driven(20);
  for (const std::int64_t stamp_ns :
       {19 * period_ns, std::int64_t{0}, INT64_MIN / 2, INT64_MAX / 2}) {
    const OdomPose pose = frame.update(stamp_ns, on_road(19), good);
    EXPECT_TRUE(pose.T_odom_base.matrix().allFinite());
    EXPECT_LT(distance_m(pose.T_odom_base, on_road(19)), 30.0);
  }
}

}  // namespace
}  // namespace stillmap
