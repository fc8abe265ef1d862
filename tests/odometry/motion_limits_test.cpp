#include "core/odometry/motion_limits.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap {
namespace {

using test::level_pose;

constexpr double period_s = 0.1;
constexpr MotionLimits limits{
    .max_speed_m_s = 10.0, .max_acceleration_m_s2 = 5.0, .max_turn_rate_rad_s = 1.0};

/// At the origin, after a period at this speed, heading and turning as it says.
RegisteredScan driven(double speed_m_s, double turned_rad = 0.0) {
  RegisteredScan last;
  last.motion = level_pose(speed_m_s * period_s, 0.0, turned_rad);
  last.interval_s = period_s;
  return last;
}

bool is_reached(const RegisteredScan& last, const Eigen::Isometry3d& T_map_lidar,
                double interval_s = period_s, bool has_velocity = true) {
  return is_reachable(last, T_map_lidar, interval_s, has_velocity, limits);
}

TEST(MotionLimits, HoldForSpeed) {
  EXPECT_TRUE(is_reached(driven(9.0), level_pose(0.9, 0.0, 0.0)));
  EXPECT_TRUE(is_reached(driven(9.0), level_pose(9.0, 0.0, 0.0), 1.0, false));
  EXPECT_FALSE(is_reached(driven(9.0), level_pose(1.3, 0.0, 0.0), period_s, false));
  EXPECT_FALSE(is_reached(driven(9.0), level_pose(12.0, 0.0, 0.0), 1.0, false));
}

TEST(MotionLimits, HoldForTurns) {
  EXPECT_TRUE(is_reached(driven(0.0), level_pose(0.0, 0.0, 0.1)));
  EXPECT_FALSE(is_reached(driven(0.0), level_pose(0.0, 0.0, 0.2)));
  EXPECT_TRUE(is_reached(driven(0.0), level_pose(0.0, 0.0, -0.2), 2 * period_s));
}

TEST(MotionLimits, HoldForAccelerationAlongAndAcrossTheWay) {
  // 5 m/s^2 over a period are 5 cm; the rest is noise.
  EXPECT_TRUE(is_reached(driven(5.0), level_pose(0.62, 0.0, 0.0)));
  EXPECT_FALSE(is_reached(driven(5.0), level_pose(0.7, 0.0, 0.0)));
  EXPECT_FALSE(is_reached(driven(5.0), level_pose(0.3, 0.0, 0.0)));
  EXPECT_FALSE(is_reached(driven(5.0), level_pose(0.5, 0.2, 0.0)));
  EXPECT_TRUE(is_reached(driven(5.0), level_pose(0.7, 0.0, 0.0), period_s, false));
}

TEST(MotionLimits, KnowTheWayInACurve) {
  // 0.1 rad to the left while it drove 0.5 m ahead: on along the old direction, which is the right.
  const RegisteredScan last = driven(5.0, 0.1);
  EXPECT_TRUE(is_reached(last, level_pose(0.5 * std::cos(0.1), -0.5 * std::sin(0.1), 0.1)));
  EXPECT_TRUE(is_reached(last, level_pose(0.5, 0.0, 0.1)));
  EXPECT_FALSE(is_reached(last, level_pose(0.5, 0.2, 0.1)));
}

TEST(OdometryWithinLimits, LosesAScanFromWhereItCannotBeAndGoesOn) {
  const test::BoxSequence sequence(test::street(), 40);
  SensorModel sensor = test::test_lidar();
  sensor.motion_limits.max_speed_m_s = 8.0;
  Odometry odometry(OdometryConfig{}, sensor);
  for (std::size_t k = 0; k < 20; ++k) {
    const OdometryResult result =
        test::register_scan(odometry, sequence.scans[k].scan, sequence.scans[k].labels()).result;
    EXPECT_NE(result.health, OdometryHealth::lost) << k;
    EXPECT_FALSE(result.is_beyond_limits) << k;
  }
  // Three metres ahead, a period later.
  Scan jumped = sequence.scans[24].scan;
  jumped.stamp_ns = sequence.scans[20].scan.stamp_ns;
  const OdometryResult result =
      test::register_scan(odometry, jumped, sequence.scans[24].labels()).result;
  EXPECT_EQ(result.health, OdometryHealth::lost);
  EXPECT_TRUE(result.is_beyond_limits);
  for (std::size_t k = 21; k < 40; ++k) {
    const OdometryResult next =
        test::register_scan(odometry, sequence.scans[k].scan, sequence.scans[k].labels()).result;
    if (k < 25) continue;
    EXPECT_EQ(next.health, OdometryHealth::good) << k;
    test::expect_near(next.T_map_lidar, sequence.T_map_lidar[k], 0.2, 0.01);
  }
}

}  // namespace
}  // namespace stillmap
