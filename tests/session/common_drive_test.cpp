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

TEST(CommonDrive, AnEarlierStateIsOfTheSameDrive) {
  const Trajectory path = curve(200, 1);
  EXPECT_TRUE(are_of_one_drive(path, path));
  EXPECT_TRUE(are_of_one_drive(path, curve(150, 1)));
  EXPECT_TRUE(are_of_one_drive(curve(150, 1), path));
}

TEST(CommonDrive, AnotherFrameAndOtherStampsAreTheSameDrive) {
  Trajectory moved = curve(200, 1, 777'000'000'000);
  const Eigen::Isometry3d T_other_map = Eigen::Translation3d(-500.0, 20.0, 7.0) *
                                        Eigen::AngleAxisd(2.1, Eigen::Vector3d(0.1, 0.0, 1.0));
  for (StampedPose& pose : moved) pose.T_map_lidar = T_other_map * pose.T_map_lidar;
  EXPECT_TRUE(are_of_one_drive(curve(150, 1), moved));
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
  EXPECT_TRUE(are_of_one_drive(curve(150, 1), corrected));
}

// Simulated, or of a lidar that takes a scan every 0.1 s by a clock that begins with it.
TEST(CommonDrive, AnotherDriveOfTheSameRouteWithTheSameStampsIsAnother) {
  for (unsigned seed = 2; seed < 20; ++seed) {
    EXPECT_FALSE(are_of_one_drive(curve(200, 1), curve(150, seed))) << seed;
  }
}

TEST(CommonDrive, WhatTellsTooLittleIsNotTakenForOne) {
  const Trajectory path = curve(200, 1);
  EXPECT_FALSE(are_of_one_drive(path, {}));
  EXPECT_FALSE(are_of_one_drive(path, curve(7, 1)));
  EXPECT_TRUE(are_of_one_drive(path, curve(8, 1)));
  Trajectory standing = path;
  for (StampedPose& pose : standing) pose.T_map_lidar.setIdentity();
  EXPECT_FALSE(are_of_one_drive(standing, standing));
  Trajectory late = path;
  late[4].stamp_ns += 1;
  EXPECT_FALSE(are_of_one_drive(path, late));
}

TEST(CommonDrive, PosesThatAreNoNumbersAreNotTakenForOne) {
  Trajectory broken = curve(200, 1);
  for (StampedPose& pose : broken) {
    pose.T_map_lidar.translation().x() = std::numeric_limits<double>::quiet_NaN();
  }
  EXPECT_FALSE(are_of_one_drive(broken, curve(200, 1)));
  EXPECT_FALSE(are_of_one_drive(broken, broken));
}

}  // namespace
}  // namespace stillmap
