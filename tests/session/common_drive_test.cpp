#include "core/session/common_drive.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace stillmap {
namespace {

/// A curve at 10 m/s with ten scans a second; the odometry's error is of this seed.
Trajectory curve(std::size_t poses, unsigned seed, std::int64_t first_stamp_ns = 0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> error_m(0.0, 0.003);
  Trajectory path;
  Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(300.0, -200.0, 2.0));
  for (std::size_t i = 0; i < poses; ++i) {
    path.push_back({first_stamp_ns + static_cast<std::int64_t>(i) * 100'000'000, T_map_lidar});
    const Eigen::Vector3d step(1.0 + error_m(random), error_m(random), error_m(random));
    T_map_lidar = T_map_lidar * Eigen::Translation3d(step) *
                  Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitZ());
  }
  return path;
}

Trajectory part_of(const Trajectory& path, std::size_t first, std::size_t poses) {
  const auto begin = path.begin() + static_cast<std::ptrdiff_t>(first);
  return {begin, begin + static_cast<std::ptrdiff_t>(poses)};
}

/// One path after the other, the second where the first ended.
Trajectory joined(Trajectory path, const Trajectory& after, std::int64_t pause_ns = 1'000'000'000) {
  const StampedPose last = path.back();
  for (const StampedPose& pose : after) {
    path.push_back({last.stamp_ns + pause_ns + pose.stamp_ns - after.front().stamp_ns,
                    last.T_map_lidar * after.front().T_map_lidar.inverse() * pose.T_map_lidar});
  }
  return path;
}

TEST(CommonDrive, AnEarlierStateIsOfTheSameDrive) {
  const Trajectory path = curve(200, 1);
  EXPECT_TRUE(common_stretch(path, path));
  EXPECT_TRUE(common_stretch(path, curve(150, 1)));
  EXPECT_TRUE(common_stretch(curve(150, 1), path));
}

TEST(CommonDrive, AnotherFrameAndOtherStampsAreTheSameDrive) {
  Trajectory moved = curve(200, 1, 777'000'000'000);
  const Eigen::Isometry3d T_other_map = Eigen::Translation3d(-500.0, 20.0, 7.0) *
                                        Eigen::AngleAxisd(2.1, Eigen::Vector3d(0.1, 0.0, 1.0));
  for (StampedPose& pose : moved) pose.T_map_lidar = T_other_map * pose.T_map_lidar;
  EXPECT_TRUE(common_stretch(curve(150, 1), moved));
}

// As a loop closure does with every submap of some scans.
TEST(CommonDrive, ACorrectionMakesItNoOtherDrive) {
  Trajectory corrected = curve(200, 1);
  constexpr std::size_t submap_scans = 20;
  for (std::size_t i = 0; i < corrected.size(); ++i) {
    const double submaps = static_cast<double>(i) / submap_scans;
    corrected[i].T_map_lidar = Eigen::Translation3d(0.04 * submaps, -0.02 * submaps, 0.0) *
                               Eigen::AngleAxisd(0.003 * submaps, Eigen::Vector3d::UnitZ()) *
                               corrected[i].T_map_lidar;
  }
  EXPECT_TRUE(common_stretch(curve(150, 1), corrected));
}

// Simulated, or of a lidar that takes a scan every 0.1 s by a clock that begins with it.
TEST(CommonDrive, AnotherDriveOfTheSameRouteWithTheSameStampsIsAnother) {
  for (unsigned seed = 2; seed < 20; ++seed) {
    EXPECT_FALSE(common_stretch(curve(200, 1), curve(150, seed))) << seed;
  }
}

TEST(CommonDrive, WhatTellsTooLittleIsNotTakenForOne) {
  const Trajectory path = curve(200, 1);
  EXPECT_FALSE(common_stretch(path, {}));
  EXPECT_FALSE(common_stretch(path, curve(7, 1)));
  EXPECT_TRUE(common_stretch(path, curve(8, 1)));
  Trajectory standing = path;
  for (StampedPose& pose : standing) pose.T_map_lidar.setIdentity();
  EXPECT_FALSE(common_stretch(standing, standing));
  // Seven poses after it.
  Trajectory late = curve(12, 1);
  late[4].stamp_ns += 1;
  EXPECT_FALSE(common_stretch(path, late));
  EXPECT_TRUE(common_stretch(path, part_of(path, 4, 8)));
  EXPECT_FALSE(common_stretch(path, part_of(path, 4, 7)));
}

TEST(CommonDrive, PosesThatAreNoNumbersAreNotTakenForOne) {
  Trajectory broken = curve(200, 1);
  for (StampedPose& pose : broken) {
    pose.T_map_lidar.translation().x() = std::numeric_limits<double>::quiet_NaN();
  }
  EXPECT_FALSE(common_stretch(broken, curve(200, 1)));
  EXPECT_FALSE(common_stretch(broken, broken));
}

// A map of several runs is one session of what it was merged into.
TEST(CommonDrive, AStretchInTheMidstOfBothIsFound) {
  const Trajectory shared = curve(85, 1);
  const Trajectory a = joined(joined(curve(5, 2), shared), curve(40, 3));
  const Trajectory b =
      joined(joined(curve(30, 4), shared, 2'000'000'000), curve(60, 5), 2'000'000'000);
  const auto stretch = common_stretch(a, b);
  ASSERT_TRUE(stretch);
  EXPECT_EQ(stretch->first_a, 5U);
  EXPECT_EQ(stretch->first_b, 30U);
  EXPECT_EQ(stretch->poses, 85U);
  EXPECT_FALSE(common_stretch(joined(curve(5, 2), curve(85, 6)), b));
}

TEST(CommonDrive, StampsThatGoOnAlikeHideNoStretch) {
  constexpr std::int64_t period_ns = 100'000'000;
  const Trajectory shared = curve(50, 1);
  const Trajectory a = joined(joined(curve(300, 2), shared, period_ns), curve(300, 3), period_ns);
  const Trajectory b = joined(joined(curve(200, 4), shared, period_ns), curve(400, 5), period_ns);
  const auto stretch = common_stretch(a, b);
  ASSERT_TRUE(stretch);
  EXPECT_NEAR(static_cast<double>(stretch->first_a), 300.0, 3.0);
  EXPECT_EQ(stretch->first_a - stretch->first_b, 100U);
  EXPECT_NEAR(static_cast<double>(stretch->poses), 50.0, 6.0);
}

// What the robot does they feel alike, each with an error of its own.
TEST(CommonDrive, TwoLidarsOfOneDriveAreTwo) {
  std::mt19937 random(1);
  std::normal_distribution<double> bump_m(0.0, 0.03);
  std::normal_distribution<double> error_m(0.0, 0.002);
  for (int drive = 0; drive < 20; ++drive) {
    Trajectory a = curve(400, 7), b = a;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const Eigen::Translation3d bump(bump_m(random), bump_m(random), bump_m(random));
      for (Trajectory* path : {&a, &b}) {
        const Eigen::Translation3d error(error_m(random), error_m(random), error_m(random));
        (*path)[i].T_map_lidar = (*path)[i].T_map_lidar * bump * error;
      }
    }
    EXPECT_FALSE(common_stretch(a, b)) << drive;
  }
}

TEST(CommonDrive, LongDrivesAreCompared) {
  constexpr std::size_t poses = 100'000;
  const Trajectory a = curve(poses, 1), b = curve(poses, 2);
  EXPECT_FALSE(common_stretch(a, b));
  const auto stretch = common_stretch(a, joined(b, part_of(a, poses / 2, 60)));
  ASSERT_TRUE(stretch);
  EXPECT_EQ(stretch->first_a, poses / 2);
  EXPECT_EQ(stretch->first_b, poses);
}

}  // namespace
}  // namespace stillmap
