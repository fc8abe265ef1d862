#include "core/odometry/sweep_motion.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "core/odometry/registration.hpp"

namespace stillmap {
namespace {

constexpr SweepTimes sweep{.middle_s = 0.05, .duration_s = 0.1};

/// Points seen from a lidar that moves as T_middle_at says, one every 5 ms.
Scan rolling_scan(const SweepMotion& motion) {
  Scan scan;
  for (int k = 0; k <= 20; ++k) {
    const double part = k / 20.0 - 0.5;
    const Eigen::Vector3d point_middle(10.0, 2.0 * k - 20.0, 1.0);
    scan.points_lidar.push_back((motion.T_middle_at(part).inverse() * point_middle).cast<float>());
    scan.time_offset_s.push_back(0.005F * static_cast<float>(k));
  }
  return scan;
}

void expect_straight(const Scan& scan) {
  for (std::size_t k = 0; k < scan.size(); ++k) {
    const Eigen::Vector3f expected(10.0F, 2.0F * static_cast<float>(k) - 20.0F, 1.0F);
    EXPECT_LT((scan.points_lidar[k] - expected).norm(), 0.002F) << "point " << k;
  }
}

TEST(SweepMotion, SteadyOneIsTakenOutOfTheScan) {
  PoseTangent twist;
  twist << 1.0, 0.2, 0.0, 0.01, 0.0, 0.1;
  const SweepMotion motion(motion_of(twist));
  EXPECT_FALSE(motion.rotation_is_measured());
  Scan scan = rolling_scan(motion);
  motion.move_to_middle(scan, sweep);
  expect_straight(scan);
}

/// Rests in the first half and turns by 0.1 rad in the second.
SweepMotion late_turn() {
  std::vector<Eigen::Matrix3d> R_middle_at;
  for (int k = 0; k <= 40; ++k)
    R_middle_at.push_back(so3_exp({0.0, 0.0, 0.2 * std::max(0.0, k / 40.0 - 0.5)}));
  return {Eigen::Vector3d(1.0, 0.0, 0.0), R_middle_at};
}

TEST(SweepMotion, MeasuredRotationNeedNotBeSteady) {
  const SweepMotion motion = late_turn();
  EXPECT_TRUE(motion.rotation_is_measured());
  EXPECT_NEAR(motion.twist()[5], 0.1, 1e-9);
  EXPECT_NEAR(so3_log(motion.T_middle_at(-0.5).linear()).norm(), 0.0, 1e-6);
  EXPECT_NEAR(so3_log(motion.T_middle_at(0.25).linear()).z(), 0.05, 1e-6);
  Scan scan = rolling_scan(motion);
  motion.move_to_middle(scan, sweep);
  expect_straight(scan);
}

TEST(SweepCorrectionTest, PointsAndPosesFollowTheSameBentMotion) {
  SweepCorrection motion;
  motion.twist << 0.5, 0.1, 0.0, 0.0, 0.01, 0.05;
  motion.bend << 0.0, 0.0, 0.02;
  Scan scan;
  std::vector<Eigen::Vector3d> points_middle;
  for (int k = 0; k <= 20; ++k) {
    const double part = k / 20.0 - 0.5;
    points_middle.emplace_back(10.0, 2.0 * k - 20.0, 1.0);
    const Eigen::Vector3d seen = T_middle_at(motion, part).inverse() * points_middle.back();
    EXPECT_LT((compensated(seen, part, motion) - points_middle.back()).norm(), 0.003) << k;
    scan.points_lidar.push_back(seen.cast<float>());
    scan.time_offset_s.push_back(0.005F * static_cast<float>(k));
  }
  move_to_middle(scan, sweep, motion);
  expect_straight(scan);
  EXPECT_TRUE(T_middle_at(motion, 0.0).isApprox(Eigen::Isometry3d::Identity()));
}

}  // namespace
}  // namespace stillmap
