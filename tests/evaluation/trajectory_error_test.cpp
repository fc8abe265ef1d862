#include "core/evaluation/trajectory_error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <vector>

namespace stillmap::evaluation {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

using Path = std::vector<Eigen::Isometry3d>;

Eigen::Isometry3d pose(double x, double y, double z, double yaw = 0.0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translate(Eigen::Vector3d(x, y, z));
  T.rotate(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  return T;
}

/// `count` poses, `step_m` apart, along x.
Path straight(std::size_t count, double step_m) {
  Path path;
  for (std::size_t i = 0; i < count; ++i) {
    path.push_back(pose(step_m * static_cast<double>(i), 0.0, 0.0));
  }
  return path;
}

/// A bent path with height: its points do not lie on a line or plane.
Path winding(std::size_t count) {
  Path path;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = 0.1 * static_cast<double>(i);
    path.push_back(
        pose(10.0 * t, 5.0 * std::sin(t), std::cos(0.7 * t), std::atan(0.5 * std::cos(t))));
  }
  return path;
}

/// Every pose of the path as seen from another world frame.
Path moved(const Eigen::Isometry3d& T_other_world, const Path& path) {
  Path result;
  for (const Eigen::Isometry3d& T : path) result.push_back(T_other_world * T);
  return result;
}

std::string refusal(const Path& truth, const Path& estimate) {
  try {
    (void)pair_by_index(truth, estimate);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(PairByIndex, KeepsPosesInStep) {
  const PosePairs pairs = pair_by_index(straight(3, 1.0), straight(3, 2.0));
  ASSERT_EQ(pairs.size(), 3U);
  EXPECT_DOUBLE_EQ(pairs.truth[2].translation().x(), 2.0);
  EXPECT_DOUBLE_EQ(pairs.estimate[2].translation().x(), 4.0);
}

TEST(PairByIndex, RefusesDifferentLengthsWithBothNumbers) {
  EXPECT_THAT(refusal(straight(3, 1.0), straight(5, 1.0)),
              testing::AllOf(HasSubstr("3 poses"), HasSubstr("5")));
}

TEST(PairByIndex, RefusesNoPoses) { EXPECT_THAT(refusal({}, {}), HasSubstr("no poses")); }

TEST(PairByIndex, NamesThePoseThatIsNotFinite) {
  Path broken = straight(4, 1.0);
  broken[2].translation().y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal(straight(4, 1.0), broken), HasSubstr("estimated pose 2"));
  EXPECT_THAT(refusal(broken, straight(4, 1.0)), HasSubstr("true pose 2"));
}

TEST(PairByIndex, RefusesScaledAndMirroredMatrices) {
  Path scaled = straight(2, 1.0);
  scaled[1].linear() *= 1.1;
  EXPECT_THAT(refusal(scaled, straight(2, 1.0)), HasSubstr("not a rotation"));
  Path mirrored = straight(2, 1.0);
  mirrored[1].linear()(2, 2) = -1.0;
  EXPECT_THAT(refusal(mirrored, straight(2, 1.0)), HasSubstr("not a rotation"));
}

TEST(PairByStamp, FindsTheNearestPoseAndLeavesOutWhatIsTooFar) {
  const Trajectory truth{{100, pose(1, 0, 0)}, {200, pose(2, 0, 0)}, {300, pose(3, 0, 0)}};
  const Trajectory estimate{{96, pose(10, 0, 0)}, {160, pose(20, 0, 0)}, {304, pose(30, 0, 0)}};
  const PosePairs pairs = pair_by_stamp(truth, estimate, 5);
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_DOUBLE_EQ(pairs.truth[0].translation().x(), 1.0);
  EXPECT_DOUBLE_EQ(pairs.estimate[0].translation().x(), 10.0);
  EXPECT_DOUBLE_EQ(pairs.truth[1].translation().x(), 3.0);
  EXPECT_DOUBLE_EQ(pairs.estimate[1].translation().x(), 30.0);
}

TEST(PairByStamp, UsesATruePoseOnce) {
  const Trajectory truth{{100, pose(1, 0, 0)}};
  const Trajectory estimate{{99, pose(10, 0, 0)}, {101, pose(20, 0, 0)}};
  EXPECT_EQ(pair_by_stamp(truth, estimate, 10).size(), 1U);
}

TEST(PairByStamp, AFasterEstimateIsTakenWhereTheTruthIs) {
  Trajectory truth, estimate;
  for (int i = 0; i <= 10; ++i) truth.push_back({100 * i, pose(i, 0, 0)});
  for (int i = 0; i <= 100; ++i) estimate.push_back({10 * i, pose(0.1 * i, 0, 0)});
  for (const bool is_swapped : {false, true}) {
    const PosePairs pairs =
        is_swapped ? pair_by_stamp(estimate, truth, 50) : pair_by_stamp(truth, estimate, 50);
    ASSERT_EQ(pairs.size(), truth.size());
    for (std::size_t i = 0; i < pairs.size(); ++i)
      EXPECT_NEAR(pairs.truth[i].translation().x(), pairs.estimate[i].translation().x(), 1e-9);
  }
}

TEST(PairByStamp, RefusesStampsThatDoNotGrowAndPathsThatNeverMeet) {
  const Trajectory good{{1, pose(0, 0, 0)}, {2, pose(1, 0, 0)}};
  const Trajectory repeated{{1, pose(0, 0, 0)}, {1, pose(1, 0, 0)}};
  const Trajectory later{{1000, pose(0, 0, 0)}, {1001, pose(1, 0, 0)}};
  EXPECT_THROW((void)pair_by_stamp(good, repeated, 5), std::invalid_argument);
  EXPECT_THROW((void)pair_by_stamp(repeated, good, 5), std::invalid_argument);
  EXPECT_THROW((void)pair_by_stamp(good, later, 5), std::invalid_argument);
  EXPECT_THROW((void)pair_by_stamp({}, good, 5), std::invalid_argument);
}

TEST(DistanceTravelled, AddsUpTheSteps) {
  const Path path{pose(0, 0, 0), pose(3, 4, 0), pose(3, 4, 2)};
  EXPECT_THAT(distance_travelled(path), ElementsAre(0.0, 5.0, 7.0));
  EXPECT_TRUE(distance_travelled({}).empty());
}

TEST(RotationAngle, IsAccurateFromTinyToHalfATurn) {
  for (const double angle : {0.0, 1e-9, 0.3, 2.0, std::numbers::pi}) {
    EXPECT_NEAR(rotation_angle(pose(1, 2, 3, angle)), angle, 1e-12);
    EXPECT_NEAR(rotation_angle(pose(1, 2, 3, -angle)), angle, 1e-12);
  }
}

Eigen::Isometry3d some_world() {
  Eigen::Isometry3d T = pose(5.0, -3.0, 2.0, 0.4);
  T.rotate(Eigen::AngleAxisd(0.2, Eigen::Vector3d(1.0, 1.0, 0.0).normalized()));
  return T;
}

TEST(AbsoluteTrajectoryError, IsZeroForTheTruthItself) {
  const PosePairs pairs{winding(50), winding(50)};
  for (const Alignment alignment : {Alignment::none, Alignment::first_pose, Alignment::rigid}) {
    EXPECT_NEAR(absolute_trajectory_error(pairs, alignment).rmse_m, 0.0, 1e-12);
  }
}

TEST(AbsoluteTrajectoryError, AlignmentTakesAwayAnotherWorldFrame) {
  const PosePairs pairs{winding(50), moved(some_world(), winding(50))};
  EXPECT_GT(absolute_trajectory_error(pairs, Alignment::none).rmse_m, 3.0);
  for (const Alignment alignment : {Alignment::first_pose, Alignment::rigid}) {
    const AbsoluteTrajectoryError error = absolute_trajectory_error(pairs, alignment);
    EXPECT_NEAR(error.rmse_m, 0.0, 1e-9);
    EXPECT_TRUE(error.T_truth_estimate.isApprox(some_world().inverse(), 1e-9));
  }
}

TEST(AbsoluteTrajectoryError, HasTheFiguresOfAKnownDeviation) {
  PosePairs pairs{straight(4, 1.0), straight(4, 1.0)};
  pairs.estimate[1].translation().y() = 3.0;
  pairs.estimate[3].translation().z() = -4.0;
  const AbsoluteTrajectoryError error = absolute_trajectory_error(pairs, Alignment::none);
  EXPECT_DOUBLE_EQ(error.rmse_m, 2.5);
  EXPECT_DOUBLE_EQ(error.mean_m, 1.75);
  EXPECT_DOUBLE_EQ(error.max_m, 4.0);
  EXPECT_DOUBLE_EQ(error.final_m, 4.0);
}

TEST(AbsoluteTrajectoryError, FirstPoseAlignmentLetsAWrongFirstHeadingCount) {
  PosePairs pairs{straight(11, 1.0), straight(11, 1.0)};
  pairs.estimate[0] = pose(0, 0, 0, 0.1);
  EXPECT_NEAR(absolute_trajectory_error(pairs, Alignment::first_pose).final_m,
              20.0 * std::sin(0.05), 1e-9);
}

TEST(RigidAlignment, IsBestAmongAlignmentsNearby) {
  PosePairs pairs{winding(60), moved(some_world(), winding(60))};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto t = static_cast<double>(i);
    pairs.estimate[i].translation() +=
        Eigen::Vector3d(std::sin(t), std::cos(2.0 * t), 0.3 * t / 60);
  }
  const AbsoluteTrajectoryError best = absolute_trajectory_error(pairs, Alignment::rigid);
  for (int axis = 0; axis < 6; ++axis) {
    for (const double by : {-1e-3, 1e-3}) {
      Eigen::Isometry3d nudge = Eigen::Isometry3d::Identity();
      if (axis < 3) nudge.translation()[axis] = by;
      if (axis >= 3) nudge.rotate(Eigen::AngleAxisd(by, Eigen::Vector3d::Unit(axis - 3)));
      const Eigen::Isometry3d T = nudge * best.T_truth_estimate;
      const PosePairs nudged{pairs.truth, moved(T, pairs.estimate)};
      EXPECT_GT(absolute_trajectory_error(nudged, Alignment::none).rmse_m, best.rmse_m)
          << axis << " " << by;
    }
  }
}

TEST(RigidAlignment, NeverMirrors) {
  // Points in a plane fit a mirror image as well as the rotation.
  PosePairs pairs{straight(10, 1.0), {}};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    pairs.truth[i].translation().y() = std::sin(static_cast<double>(i));
  }
  pairs.estimate = moved(some_world(), pairs.truth);
  const AbsoluteTrajectoryError error = absolute_trajectory_error(pairs, Alignment::rigid);
  EXPECT_NEAR(error.T_truth_estimate.linear().determinant(), 1.0, 1e-9);
  EXPECT_NEAR(error.rmse_m, 0.0, 1e-9);
}

TEST(RigidAlignment, CopesWithALineAndWithOnePose) {
  const PosePairs line{straight(5, 1.0), moved(some_world(), straight(5, 1.0))};
  EXPECT_NEAR(absolute_trajectory_error(line, Alignment::rigid).rmse_m, 0.0, 1e-9);
  const PosePairs one{straight(1, 1.0), moved(some_world(), straight(1, 1.0))};
  EXPECT_NEAR(absolute_trajectory_error(one, Alignment::rigid).rmse_m, 0.0, 1e-9);
}

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

Path read_poses(const std::filesystem::path& file) {
  std::ifstream stream(file);
  Path path;
  Eigen::Matrix<double, 3, 4> rows;
  while (true) {
    for (int i = 0; i < 12; ++i) stream >> rows(i / 4, i % 4);
    if (!stream) return path;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.matrix().topRows<3>() = rows;
    path.push_back(T);
  }
}

// The figures were made with the benchmark's own development kit.
TEST(KittiOdometryError, AgreesWithTheDevelopmentKitOnARealEstimate) {
  const char* data = std::getenv("STILLMAP_TEST_DATA");
  if (data == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA does not name the folder of sequences";
  const std::filesystem::path folder = std::filesystem::path(data) / "kitti_metric";
  const PosePairs pairs = pair_by_index(read_poses(folder / "05_ground_truth.txt"),
                                        read_poses(folder / "05_estimate.txt"));
  const KittiOdometryError error = kitti_odometry_error(pairs).value();
  EXPECT_NEAR(error.translation_percent, 0.426, 0.0005);
  EXPECT_NEAR(error.rotation_deg_per_100m, 0.159, 0.0005);
}

}  // namespace

}  // namespace stillmap::evaluation
