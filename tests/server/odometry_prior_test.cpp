#include "server/mapping/odometry_prior.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace stillmap::server {
namespace {

constexpr std::int64_t ms = 1'000'000;

Eigen::Isometry3d at(double x, double yaw) {
  return Eigen::Isometry3d(Eigen::Translation3d(x, 5.0, 0.0) *
                           Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

PoseBuffer drive() {
  PoseBuffer poses;
  for (int i = 0; i <= 10; ++i) poses.add({i * 100 * ms, at(i, 0.0)});
  return poses;
}

TEST(PoseBuffer, InterpolatesTheMotion) {
  const auto motion = drive().motion(150 * ms, 420 * ms);
  ASSERT_TRUE(motion);
  EXPECT_TRUE(motion->translation().isApprox(Eigen::Vector3d(2.7, 0.0, 0.0), 1e-9));
}

TEST(PoseBuffer, TurnsTheMotionIntoTheFirstPosesFrame) {
  PoseBuffer poses;
  poses.add({0, at(0.0, std::numbers::pi / 2)});
  poses.add({100 * ms, at(1.0, std::numbers::pi / 2)});
  const auto motion = poses.motion(0, 100 * ms);
  ASSERT_TRUE(motion);
  EXPECT_TRUE(motion->translation().isApprox(Eigen::Vector3d(0.0, -1.0, 0.0), 1e-9));
}

TEST(PoseBuffer, KnowsNothingOfOtherTimes) {
  EXPECT_FALSE(drive().motion(-1, 100 * ms));
  EXPECT_FALSE(drive().motion(500 * ms, 1101 * ms));
  EXPECT_FALSE(PoseBuffer().motion(0, 1));
}

TEST(PoseBuffer, CarriesTheNewestMotionOnALittle) {
  const auto motion = drive().motion(900 * ms, 1050 * ms);
  ASSERT_TRUE(motion);
  EXPECT_TRUE(motion->translation().isApprox(Eigen::Vector3d(1.5, 0.0, 0.0), 1e-9));
}

TEST(PoseBuffer, BeginsAnewWhereTheClockWasSet) {
  for (const std::int64_t begin : {-3'600'000 * ms, 3'600'000 * ms}) {
    PoseBuffer poses = drive();
    int left_out = 0;
    for (int i = 0; i < 10; ++i) {
      if (!poses.add({begin + i * 100 * ms, at(i, 0.0)})) ++left_out;
    }
    EXPECT_EQ(left_out, 5);
    EXPECT_TRUE(poses.motion(begin, begin + 900 * ms)) << begin;
    EXPECT_FALSE(poses.motion(0, 100 * ms));
  }
}

TEST(PoseBuffer, IsNotSilencedByOnePoseOfTheFuture) {
  // A little ahead, an hour, and as far as stamps go.
  for (const std::int64_t ahead : {3'000 * ms, 3'600'000 * ms, 2'000'000'000'000 * ms}) {
    PoseBuffer poses = drive();
    poses.add({1000 * ms + ahead, at(-1000.0, 1.0)});
    for (int i = 11; i <= 20; ++i) poses.add({i * 100 * ms, at(i, 0.0)});
    const auto motion = poses.motion(1600 * ms, 1900 * ms);
    ASSERT_TRUE(motion) << ahead;
    EXPECT_TRUE(motion->translation().isApprox(Eigen::Vector3d(3.0, 0.0, 0.0), 1e-9));
  }
}

TEST(PoseBuffer, LeavesOutWhatComesOutOfOrder) {
  PoseBuffer poses = drive();
  EXPECT_FALSE(poses.add({500 * ms, at(1000.0, 0.0)}));
  EXPECT_TRUE(poses.motion(400 * ms, 600 * ms)
                  ->translation()
                  .isApprox(Eigen::Vector3d(2.0, 0.0, 0.0), 1e-9));
}

TEST(PoseBuffer, CarriesACurveOn) {
  const Eigen::Isometry3d step(Eigen::Translation3d(1.0, 0.2, 0.0) *
                               Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  PoseBuffer poses;
  Eigen::Isometry3d T_odom_robot = at(3.0, 0.5);
  for (int i = 0; i <= 10; ++i) {
    poses.add({i * 100 * ms, T_odom_robot});
    T_odom_robot = T_odom_robot * step;
  }
  const auto motion = poses.motion(1000 * ms, 1100 * ms);
  ASSERT_TRUE(motion);
  EXPECT_TRUE(motion->isApprox(step, 1e-9)) << motion->matrix();
}

TEST(PoseBuffer, CarriesNothingOnThatHasStopped) {
  PoseBuffer poses = drive();
  for (int i = 11; i <= 13; ++i) poses.add({i * 100 * ms, at(10.0, 0.0)});
  const auto motion = poses.motion(1300 * ms, 1390 * ms);
  ASSERT_TRUE(motion);
  EXPECT_LT(motion->translation().norm(), 1e-9);
}

TEST(PoseBuffer, StampsThatJitterAreNoSpeed) {
  constexpr double speed_m_s = 10.0;
  constexpr double jitter_s = 0.002;
  // The last two stamps are 14 ms apart, and 6 ms.
  for (const int last : {100, 99}) {
    PoseBuffer poses;
    std::int64_t newest_ns = 0;
    for (int i = 0; i <= last; ++i) {
      newest_ns = i * 10 * ms + (i % 2 == 0 ? 2 * ms : -2 * ms);
      poses.add({newest_ns, at(0.01 * speed_m_s * i, 0.0)});
    }
    const auto x_after_50_ms = [&] {
      return poses.pose_at(newest_ns + 50 * ms)->translation().x();
    };
    const double expected = speed_m_s * (1e-9 * static_cast<double>(newest_ns) + 0.05);
    EXPECT_NEAR(x_after_50_ms(), expected, 4.0 * jitter_s * speed_m_s) << last;
    // One more of nearly the same stamp, a centimetre on.
    poses.add({newest_ns += 1000, at(0.01 * speed_m_s * last + 0.01, 0.0)});
    EXPECT_NEAR(x_after_50_ms(), expected, 4.0 * jitter_s * speed_m_s) << last;
  }
}

TEST(PoseBuffer, AnOdometryThatSetItselfElsewhereIsNotCarriedOn) {
  PoseBuffer poses;
  for (int i = 0; i <= 50; ++i) poses.add({i * 20 * ms, at(0.2 * i + (i == 50 ? 5.0 : 0.0), 0.0)});
  EXPECT_NEAR(poses.pose_at(1040 * ms)->translation().x(), 15.0, 1e-9);
}

TEST(PoseBuffer, TheNewestPoseStandsWhereItsMotionIsNotKnown) {
  PoseBuffer poses;
  poses.add({0, at(3.0, 0.0)});
  EXPECT_EQ(poses.pose_at(50 * ms)->translation().x(), 3.0) << "there is one";
  poses.add({1000 * ms, at(13.0, 0.0)});
  EXPECT_EQ(poses.pose_at(1050 * ms)->translation().x(), 13.0) << "a second lies between them";
}

}  // namespace
}  // namespace stillmap::server
