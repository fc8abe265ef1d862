#include "core/evaluation/relative_pose_error.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/evaluation/simple_paths.hpp"

namespace stillmap::evaluation {
namespace {

using test::moved;
using test::Path;
using test::pose;
using test::straight;
using test::winding;

// A path that repeats one motion.
Path repeated(const Eigen::Isometry3d& step, std::size_t count) {
  Path path{Eigen::Isometry3d::Identity()};
  while (path.size() < count) path.push_back(path.back() * step);
  return path;
}

TEST(RelativePoseError, IsTheErrorOfEachStep) {
  const PosePairs pairs{repeated(pose(1.0, 0, 0), 11), repeated(pose(1.02, 0, 0), 11)};
  const RelativePoseError error = relative_pose_error(pairs).value();
  EXPECT_NEAR(error.mean_translation_m, 0.02, 1e-12);
  EXPECT_NEAR(error.rmse_translation_m, 0.02, 1e-12);
  EXPECT_NEAR(error.max_translation_m, 0.02, 1e-12);
  EXPECT_NEAR(error.mean_rotation_rad, 0.0, 1e-12);
}

TEST(RelativePoseError, SeesARotationPerStep) {
  const PosePairs pairs{repeated(pose(1.0, 0, 0), 11), repeated(pose(1.0, 0, 0, 0.01), 11)};
  const RelativePoseError error = relative_pose_error(pairs).value();
  EXPECT_NEAR(error.mean_rotation_rad, 0.01, 1e-12);
  EXPECT_NEAR(error.max_rotation_rad, 0.01, 1e-12);
}

TEST(RelativePoseError, CountsOneJumpOnce) {
  PosePairs pairs{straight(5, 1.0), straight(5, 1.0)};
  for (std::size_t i = 2; i < 5; ++i) pairs.estimate[i].translation().y() += 0.4;
  const RelativePoseError error = relative_pose_error(pairs).value();
  EXPECT_NEAR(error.mean_translation_m, 0.1, 1e-12);
  EXPECT_NEAR(error.rmse_translation_m, 0.2, 1e-12);
  EXPECT_NEAR(error.max_translation_m, 0.4, 1e-12);
}

TEST(RelativePoseError, DoesNotDependOnTheWorldFrames) {
  const PosePairs pairs{winding(30), moved(pose(7, 8, 9, 1.0), winding(30))};
  EXPECT_NEAR(relative_pose_error(pairs)->max_translation_m, 0.0, 1e-9);
}

TEST(RelativePoseError, IsNothingForOnePose) {
  EXPECT_FALSE(relative_pose_error({straight(1, 1.0), straight(1, 1.0)}).has_value());
}

TEST(KittiOdometryError, IsTheScaleErrorOfAScaledStraight) {
  const PosePairs pairs{straight(1000, 1.0), straight(1000, 1.02)};
  const KittiOdometryError error = kitti_odometry_error(pairs).value();
  // A segment ends at the first pose past its length, so one step longer than it says.
  EXPECT_NEAR(error.by_length.at(0).translation_percent, 2.0 * 101.0 / 100.0, 1e-9);
  EXPECT_NEAR(error.by_length.at(7).translation_percent, 2.0 * 801.0 / 800.0, 1e-9);
  EXPECT_NEAR(error.rotation_deg_per_100m, 0.0, 1e-9);
}

TEST(KittiOdometryError, IsTheYawRateOfASteadyTurn) {
  const double yaw_per_m = 1e-4;
  const PosePairs pairs{repeated(pose(1, 0, 0), 120), repeated(pose(1, 0, 0, yaw_per_m), 120)};
  EXPECT_NEAR(kitti_odometry_error(pairs)->rotation_deg_per_100m,
              101.0 * yaw_per_m * 180.0 / std::numbers::pi, 1e-9);
}

TEST(KittiOdometryError, BeginsASegmentAtEveryTenthPose) {
  const PosePairs pairs{straight(251, 1.0), straight(251, 1.0)};
  const KittiOdometryError error = kitti_odometry_error(pairs).value();
  ASSERT_EQ(error.by_length.size(), 2U);
  EXPECT_EQ(error.by_length[0].segments, 15U);  // from 0, 10 .. 140
  EXPECT_EQ(error.by_length[1].segments, 5U);   // from 0, 10 .. 40
  EXPECT_EQ(error.segments, 20U);
}

TEST(KittiOdometryError, IsNothingForAShortPath) {
  EXPECT_FALSE(kitti_odometry_error({straight(99, 1.0), straight(99, 1.0)}).has_value());
  EXPECT_FALSE(kitti_odometry_error({straight(1, 1.0), straight(1, 1.0)}).has_value());
}

}  // namespace
}  // namespace stillmap::evaluation
