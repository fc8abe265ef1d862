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

TEST(PoseBuffer, StretchesTheNewestPoseALittle) {
  const auto motion = drive().motion(900 * ms, 1050 * ms);
  ASSERT_TRUE(motion);
  EXPECT_TRUE(motion->translation().isApprox(Eigen::Vector3d(1.0, 0.0, 0.0), 1e-9));
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

}  // namespace
}  // namespace stillmap::server
