#include "core/evaluation/pose_pairs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "tests/evaluation/simple_paths.hpp"

namespace stillmap::evaluation {
namespace {

using test::Path;
using test::pose;
using test::straight;
using testing::ElementsAre;
using testing::HasSubstr;

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

}  // namespace
}  // namespace stillmap::evaluation
