#include "core/evaluation/absolute_trajectory_error.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/evaluation/simple_paths.hpp"

namespace stillmap::evaluation {
namespace {

using test::moved;
using test::Path;
using test::pose;
using test::straight;
using test::winding;

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
  const double best = absolute_trajectory_error(pairs, Alignment::rigid).rmse_m;
  for (int axis = 0; axis < 6; ++axis) {
    for (const double by : {-1e-3, 1e-3}) {
      Eigen::Isometry3d nudge = Eigen::Isometry3d::Identity();
      if (axis < 3) nudge.translation()[axis] = by;
      if (axis >= 3) nudge.rotate(Eigen::AngleAxisd(by, Eigen::Vector3d::Unit(axis - 3)));
      const Eigen::Isometry3d T = nudge * find_alignment(pairs, Alignment::rigid);
      const PosePairs nudged{pairs.truth, moved(T, pairs.estimate)};
      EXPECT_GT(absolute_trajectory_error(nudged, Alignment::none).rmse_m, best)
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

TEST(AlignmentFromName, KnowsItsThreeNames) {
  EXPECT_EQ(alignment_from_name("none"), Alignment::none);
  EXPECT_EQ(alignment_from_name("first"), Alignment::first_pose);
  EXPECT_EQ(alignment_from_name("rigid"), Alignment::rigid);
  EXPECT_FALSE(alignment_from_name("Rigid").has_value());
}

}  // namespace
}  // namespace stillmap::evaluation
