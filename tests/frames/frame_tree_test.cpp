#include "core/frames/frame_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/frames/rigid_motion.hpp"

namespace stillmap {
namespace {

Eigen::Isometry3d at(double x, double yaw = 0.0) {
  return from_xyz_rpy({x, 0.0, 0.0}, {0.0, 0.0, yaw});
}

/// base_link -> mast -> lidar, and base_link -> imu.
FrameTree robot() {
  FrameTree tree;
  EXPECT_TRUE(tree.set({"mast", "lidar", at(0.5)}));
  EXPECT_TRUE(tree.set({"base_link", "mast", at(1.0, 1.0)}));
  EXPECT_TRUE(tree.set({"base_link", "imu", at(-0.2)}));
  return tree;
}

TEST(FrameTree, ChainsTransformsInEitherSense) {
  const auto T_base_lidar = robot().find("base_link", "lidar");
  ASSERT_TRUE(T_base_lidar);
  EXPECT_TRUE(T_base_lidar->isApprox(at(1.0, 1.0) * at(0.5)));
  EXPECT_TRUE(robot().find("lidar", "base_link")->isApprox(T_base_lidar->inverse()));
}

TEST(FrameTree, FindsFramesOfDifferentBranches) {
  EXPECT_TRUE(robot().find("imu", "mast")->isApprox(at(0.2) * at(1.0, 1.0)));
}

TEST(FrameTree, KnowsAFrameInItself) {
  EXPECT_TRUE(robot().find("lidar", "lidar")->isApprox(Eigen::Isometry3d::Identity()));
}

TEST(FrameTree, FindsNothingBetweenTreesThatAreApart) {
  FrameTree tree = robot();
  EXPECT_TRUE(tree.set({"trailer", "rear_lidar", at(1.0)}));
  EXPECT_FALSE(tree.find("base_link", "rear_lidar"));
  EXPECT_FALSE(tree.find("base_link", "camera"));
}

TEST(FrameTree, LeavesOutTheSlashOfOldNames) {
  FrameTree tree;
  EXPECT_TRUE(tree.set({"/base_link", "/lidar", at(1.0)}));
  EXPECT_TRUE(tree.find("base_link", "/lidar"));
}

TEST(FrameTree, TakesTheLastTransformOfAChild) {
  FrameTree tree = robot();
  EXPECT_TRUE(tree.set({"base_link", "lidar", at(3.0)}));
  EXPECT_TRUE(tree.find("base_link", "lidar")->isApprox(at(3.0)));
}

TEST(FrameTree, RefusesWhatCannotBe) {
  FrameTree tree = robot();
  Eigen::Isometry3d nan = at(1.0);
  nan.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(tree.set({"base_link", "lidar", nan}));
  EXPECT_FALSE(tree.set({"base_link", "lidar", at(1e300)}));
  EXPECT_FALSE(tree.set({"", "lidar", at(1.0)}));
  EXPECT_FALSE(tree.set({"base_link", "", at(1.0)}));
  EXPECT_FALSE(tree.set({"lidar", "lidar", at(1.0)}));
  EXPECT_FALSE(tree.set({"lidar", "base_link", at(1.0)}));
  EXPECT_TRUE(tree.find("base_link", "lidar")->isApprox(at(1.0, 1.0) * at(0.5)));
}

TEST(FrameTree, HoldsAsManyFramesAsARobotHas) {
  FrameTree tree;
  int taken = 0;
  for (int i = 0; i < 20'000; ++i) {
    taken += tree.set({"base_link", "frame" + std::to_string(i), at(1.0)}) ? 1 : 0;
  }
  EXPECT_EQ(taken, 10'000);
  EXPECT_TRUE(tree.set({"base_link", "frame7", at(-1.0)}));
}

TEST(FrameTree, ListsItsFrames) {
  EXPECT_THAT(robot().frames(), ::testing::ElementsAre("base_link", "imu", "lidar", "mast"));
}

}  // namespace
}  // namespace stillmap
