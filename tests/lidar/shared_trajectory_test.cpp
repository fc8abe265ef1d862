#include "core/lidar/shared_trajectory.hpp"

#include <gtest/gtest.h>

#include <random>

namespace stillmap {
namespace {

StampedPose pose_at(std::int64_t stamp_ns, double x_m = 0.0) {
  return {stamp_ns, Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.0, 0.0))};
}

std::vector<std::int64_t> stamps(const SharedTrajectory& poses) {
  std::vector<std::int64_t> out;
  for (const StampedPose& pose : poses) out.push_back(pose.stamp_ns);
  return out;
}

TEST(SharedTrajectory, AgreesWithAVectorUnderRandomChanges) {
  std::mt19937 random(5);
  SharedTrajectory poses;
  std::vector<std::int64_t> expected;
  for (int round = 0; round < 60; ++round) {
    const SharedTrajectory before = poses;
    const std::vector<std::int64_t> expected_before = expected;
    if (random() % 3 == 0 && !expected.empty()) {
      expected.resize(random() % expected.size());
      poses.truncate(expected.size());
    }
    for (std::size_t count = random() % 700; count > 0; --count) {
      expected.push_back(expected.empty() ? 1 : expected.back() + 2);
      poses.push_back(pose_at(expected.back()));
    }
    ASSERT_EQ(stamps(poses), expected);
    ASSERT_EQ(stamps(before), expected_before) << "a copy never changes";
    if (expected.empty()) continue;
    EXPECT_EQ(poses.back().stamp_ns, expected.back());
    const std::size_t some = random() % expected.size();
    EXPECT_EQ(poses.lower_bound(expected[some]), some);
    EXPECT_EQ(poses.lower_bound(expected[some] - 1), some);
  }
  EXPECT_EQ(poses.lower_bound(1'000'000'000), poses.size());
}

TEST(SharedTrajectory, CopiesShareTheirPoses) {
  SharedTrajectory poses;
  for (int i = 0; i < 10'000; ++i) poses.push_back(pose_at(i));
  const SharedTrajectory copy = poses;
  std::size_t own = 0;
  for (std::size_t i = 0; i < copy.size(); ++i) {
    if (&copy[i] != &poses[i]) ++own;
  }
  EXPECT_LT(own, SharedTrajectory::piece_poses);
}

TEST(SharedTrajectory, TellsHowFarTwoAreTheSame) {
  SharedTrajectory a;
  for (int i = 0; i < 1000; ++i) a.push_back(pose_at(i));
  SharedTrajectory b = a;
  EXPECT_EQ(SharedTrajectory::common_poses(a, b), 1000U);
  b.push_back(pose_at(1000));
  EXPECT_EQ(SharedTrajectory::common_poses(a, b), 1000U);
  b.truncate(300);
  b.push_back(pose_at(300, 0.5));
  EXPECT_EQ(SharedTrajectory::common_poses(a, b), 300U) << "same stamp, another pose";
  EXPECT_EQ(SharedTrajectory::common_poses(a, a.to_vector()), 1000U) << "equal in other memory";
  EXPECT_EQ(SharedTrajectory::common_poses(a, {}), 0U);
}

}  // namespace
}  // namespace stillmap
