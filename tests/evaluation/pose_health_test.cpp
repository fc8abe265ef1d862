#include "core/evaluation/pose_health.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>

namespace stillmap::evaluation {
namespace {

using testing::Each;
using testing::ElementsAre;
using Drive = std::vector<EvaluatedPose>;

Eigen::Isometry3d at(double x, double y = 0.0, double yaw_deg = 0.0) {
  return Eigen::Translation3d(x, y, 0.0) *
         Eigen::AngleAxisd(yaw_deg * std::numbers::pi / 180.0, Eigen::Vector3d::UnitZ());
}

EvaluatedPose evaluated(const Eigen::Isometry3d& T_true, const Eigen::Isometry3d& T_estimate,
                        OdometryHealth health = OdometryHealth::good) {
  return {T_true, T_estimate, health};
}

/// One metre a scan; the estimate goes `factor` times as far, in a frame of its own.
Drive straight(int scans, double factor) {
  const Eigen::Isometry3d T_map_world = at(30.0, -20.0, 70.0);
  Drive drive;
  for (int k = 0; k < scans; ++k) drive.push_back(evaluated(at(k), T_map_world * at(factor * k)));
  return drive;
}

TEST(WrongPoses, AreNoneWhereOnlyTheFramesDiffer) {
  EXPECT_THAT(wrong_poses(straight(100, 1.0)), Each(false));
}

TEST(WrongPoses, AreNoneOfADriveThatDriftsAsUsual) {
  EXPECT_THAT(wrong_poses(straight(2000, 1.01)), Each(false));
}

TEST(WrongPoses, BeginWhereADriveThatSlidesIsAMetreOff) {
  const std::vector<bool> wrong = wrong_poses(straight(100, 1.08));
  EXPECT_EQ(std::ranges::find(wrong, true) - wrong.begin(), 13);
  EXPECT_TRUE(wrong.back());
}

TEST(WrongPoses, BeginWhereASlowDriveThatSeemsToStandHasGoneAMetre) {
  Drive drive;
  for (int k = 0; k < 60; ++k) drive.push_back(evaluated(at(0.15 * k), at(0.0)));
  const std::vector<bool> wrong = wrong_poses(drive);
  EXPECT_EQ(std::ranges::find(wrong, true) - wrong.begin(), 7);
  EXPECT_TRUE(wrong.back());
}

TEST(WrongPoses, AreThoseOfAJumpUntilItIsMadeGood) {
  const Drive drive{evaluated(at(0), at(0)),   evaluated(at(1), at(1)), evaluated(at(2), at(2.5)),
                    evaluated(at(3), at(3.5)), evaluated(at(4), at(4)), evaluated(at(5), at(5.1))};
  EXPECT_THAT(wrong_poses(drive), ElementsAre(false, false, true, true, false, false));
}

TEST(WrongPoses, AreNotThoseThatComeBackFromOnesCalledDegenerate) {
  using enum OdometryHealth;
  const Drive drive{
      evaluated(at(0), at(0), initialised),        evaluated(at(1), at(1)),
      evaluated(at(2), at(2, 0, 0.9), degenerate), evaluated(at(3), at(3, 0, 1.0), degenerate),
      evaluated(at(4), at(4, 0, 2.5), degenerate), evaluated(at(5), at(5, 0, -0.5))};
  EXPECT_THAT(wrong_poses(drive), ElementsAre(false, false, false, false, true, false));
}

TEST(WrongPoses, AreThoseThatAreTurned) {
  const Drive drive{evaluated(at(0), at(0)), evaluated(at(1), at(1, 0, 0.9)),
                    evaluated(at(2), at(2, 0, 3.0))};
  EXPECT_THAT(wrong_poses(drive), ElementsAre(false, false, true));
}

TEST(WrongPoses, AreAllWithoutATruthAndDoNotMoveTheReference) {
  Drive drive = straight(6, 1.0);
  for (const std::size_t k : {2U, 3U}) drive[k] = {std::nullopt, at(900), OdometryHealth::good};
  EXPECT_THAT(wrong_poses(drive), ElementsAre(false, false, true, true, false, false));
}

TEST(WrongPoses, AreThoseAfterARecordingJumpsOnUnlessTheEstimateFollows) {
  const Drive stays{evaluated(at(0), at(0)), evaluated(at(1), at(1)), evaluated(at(151), at(2)),
                    evaluated(at(152), at(150))};
  EXPECT_THAT(wrong_poses(stays), ElementsAre(false, false, true, true));
  const Drive follows{evaluated(at(0), at(0)), evaluated(at(1), at(1)),
                      evaluated(at(151), at(151.1))};
  EXPECT_THAT(wrong_poses(follows), Each(false));
}

TEST(WrongPoses, AreThoseThatAreNoNumbers) {
  Drive drive = straight(3, 1.0);
  drive[1].T_map_lidar.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(wrong_poses(drive), ElementsAre(false, true, false));
}

TEST(WrongPoses, AreNoneOfNoDrive) { EXPECT_TRUE(wrong_poses({}).empty()); }

TEST(HealthScore, CountsWhatIsCalledWhatItIsNot) {
  using enum OdometryHealth;
  const Drive drive{evaluated(at(0), at(0), initialised), evaluated(at(1), at(1), good),
                    evaluated(at(2), at(2), lost),        evaluated(at(3), at(3), degenerate),
                    evaluated(at(4), at(9), good),        evaluated(at(5), at(9), lost),
                    evaluated(at(6), at(9), degenerate),  evaluated(at(7), at(7), good)};
  const HealthScore score = health_score(drive);
  EXPECT_EQ(score.poses, 8U);
  EXPECT_EQ(score.wrong, 3U);
  EXPECT_THAT(score.wrong_called_good, ElementsAre(4));
  EXPECT_THAT(score.right_called_bad, ElementsAre(2));
}

}  // namespace
}  // namespace stillmap::evaluation
