#include "core/odometry/unconfirmed_stretch.hpp"

#include <gtest/gtest.h>

#include "tests/odometry/poses.hpp"
#include "tests/odometry/surface_world.hpp"

namespace stillmap {
namespace {

using enum UnconfirmedStretch::Decision;
using test::expect_near;
using test::level_pose;
using test::SurfaceWorld;
using Decision = UnconfirmedStretch::Decision;

/// A road of 40 m with a facade along it, so far to the left, and walls across it on both sides.
SurfaceWorld road_with_walls(std::initializer_list<double> walls_x_m, double facade_y_m = 8.0) {
  SurfaceWorld world;
  const Eigen::Vector3d up(0.0, 0.0, 5.0);
  world.planes.push_back(
      {{-10.0, -8.0, -1.7}, {40.0, 0.0, 0.0}, {0.0, 16.0, 0.0}, SemanticClass::road});
  world.planes.push_back(
      {{-10.0, facade_y_m, -1.7}, {40.0, 0.0, 0.0}, up, SemanticClass::building});
  for (const double x : walls_x_m) {
    world.planes.push_back({{x, 4.0, -1.7}, {0.0, 4.0, 0.0}, up, SemanticClass::building});
    world.planes.push_back({{x, -8.0, -1.7}, {0.0, 4.0, 0.0}, up, SemanticClass::building});
  }
  return world;
}

SurfaceWorld here() { return road_with_walls({-8.0, -1.0, 7.0, 16.0, 24.0}); }

OdometryResult good_at(const Eigen::Isometry3d& T_map_lidar) {
  return {.T_map_lidar = T_map_lidar, .health = OdometryHealth::good, .upright_fit = 0.9};
}

/// A stretch after scans of `here()` that fitted its map.
UnconfirmedStretch stretch_of_here() {
  UnconfirmedStretch::Trusted trusted{here().local_map(), {}, ScanIntervals(0.1), {}};
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Eigen::Isometry3d T = level_pose(0.1 * seed, 0.0, 0.0);
    trusted.fits.add(register_features(here().features(T, 0.01, seed), trusted.map, T, {}));
  }
  return UnconfirmedStretch(std::move(trusted));
}

/// One that was looked for, and found so far ahead of where it was expected [m].
void jump(UnconfirmedStretch& stretch, double distance_m) {
  stretch.jump(Eigen::Isometry3d::Identity(), level_pose(distance_m, 0.0, 0.0));
}

/// What the stretch says of scans of a world that were registered with this error, which drive on
/// by so much each [m].
std::vector<Decision> judged(UnconfirmedStretch& stretch, const SurfaceWorld& world, int scans,
                             double step_m, const Eigen::Isometry3d& error) {
  std::vector<Decision> decisions;
  for (int k = 0; k < scans; ++k) {
    const Eigen::Isometry3d T_true = level_pose(step_m * k, 0.0, 0.0);
    OdometryResult found = good_at(T_true * error);
    const auto seed = static_cast<unsigned>(20 + k);
    decisions.push_back(stretch.evaluate(world.features(T_true, 0.01, seed), {}, found));
    if (decisions.back() != open) break;
  }
  return decisions;
}

TEST(UnconfirmedStretch, EndsWithTheFirstScanOnTheTrustedMapAndTakesItsPose) {
  UnconfirmedStretch stretch = stretch_of_here();
  const Eigen::Isometry3d T_true = level_pose(3.0, 0.5, 0.02);
  OdometryResult found = good_at(T_true * level_pose(0.3, 0.1, 0.02));
  EXPECT_EQ(stretch.evaluate(here().features(T_true, 0.01, 3), {}, found), confirmed);
  expect_near(found.T_map_lidar, T_true, 0.02, 0.005);
  // Those before it may have slid as far.
  EXPECT_EQ(found.map_entry, MapEntry::enters);
}

TEST(UnconfirmedStretch, ThatWasFollowedAllAlongIsAPartOfTheMapOnceItsEndIs) {
  UnconfirmedStretch stretch = stretch_of_here();
  const Eigen::Isometry3d T_true = level_pose(3.0, 0.5, 0.02);
  OdometryResult found = good_at(T_true);
  found.health = OdometryHealth::degenerate;
  ASSERT_EQ(stretch.evaluate(here().features(T_true, 0.01, 3), {}, found), open);
  EXPECT_EQ(found.map_entry, MapEntry::waits);
  found = good_at(T_true * level_pose(0.05, 0.0, 0.0));
  ASSERT_EQ(stretch.evaluate(here().features(T_true, 0.01, 4), {}, found), confirmed);
  EXPECT_EQ(found.map_entry, MapEntry::enters_with_waiting);
}

TEST(UnconfirmedStretch, ThatWasLookedForIsNoPartOfTheMapUntilItIsConfirmed) {
  UnconfirmedStretch stretch = stretch_of_here();
  jump(stretch, 20.0);
  for (int k = 0; k < 30; ++k) {
    const Eigen::Isometry3d T_true = level_pose(0.5 * k, 0.0, 0.0);
    OdometryResult found = good_at(T_true);
    const auto decision =
        stretch.evaluate(here().features(T_true, 0.01, static_cast<unsigned>(20 + k)), {}, found);
    EXPECT_EQ(found.map_entry,
              decision == open ? MapEntry::stays_out_with_waiting : MapEntry::enters);
    if (decision != open) return;
  }
  FAIL() << "not confirmed";
}

TEST(UnconfirmedStretch, EndsWithScansInARowThatAgreeInThePartThatIsKnown) {
  SurfaceWorld farther = here();
  farther.planes.push_back(
      {{40.0, -8.0, -1.7}, {70.0, 0.0, 0.0}, {0.0, 24.0, 0.0}, SemanticClass::road});
  UnconfirmedStretch stretch = stretch_of_here();
  const auto decisions = judged(stretch, farther, 10, 0.5, Eigen::Isometry3d::Identity());
  EXPECT_EQ(decisions, (std::vector<Decision>{open, open, open, open, confirmed}));
  // Looked for, it would be too little.
  UnconfirmedStretch jumped = stretch_of_here();
  jump(jumped, 20.0);
  EXPECT_EQ(judged(jumped, farther, 15, 0.5, Eigen::Isometry3d::Identity()),
            std::vector<Decision>(15, open));
}

TEST(UnconfirmedStretch, IsNotJudgedByScansThatDoNotShowTheirMotion) {
  UnconfirmedStretch stretch = stretch_of_here();
  const Eigen::Isometry3d T_true = level_pose(3.0, 0.0, 0.0);
  OdometryResult found = good_at(T_true);
  found.health = OdometryHealth::degenerate;
  EXPECT_EQ(stretch.evaluate(here().features(T_true, 0.01, 3), {}, found), open);
}

TEST(UnconfirmedStretch, IsContradictedByScansInARowOfAnotherPlace) {
  UnconfirmedStretch stretch = stretch_of_here();
  const SurfaceWorld elsewhere = road_with_walls({-4.5, 3.0, 11.5, 20.0}, 5.5);
  const auto decisions = judged(stretch, elsewhere, 10, 0.0, Eigen::Isometry3d::Identity());
  EXPECT_EQ(decisions, (std::vector<Decision>{open, open, open, open, contradicted}));
}

TEST(UnconfirmedStretch, IsNotContradictedWhereTrafficHidesThePlaceFromWhatWasSeenSince) {
  UnconfirmedStretch stretch = stretch_of_here();
  const SurfaceWorld hidden = road_with_walls({-4.5, 3.0, 11.5, 20.0}, 5.5);
  for (unsigned seed = 1; seed <= 10; ++seed) {
    OdometryResult found = good_at(Eigen::Isometry3d::Identity());
    found.upright_fit = 0.4;
    EXPECT_EQ(
        stretch.evaluate(hidden.features(Eigen::Isometry3d::Identity(), 0.01, seed), {}, found),
        open);
  }
}

TEST(UnconfirmedStretch, StaysOpenWhereTheTrustedMapKnowsNothing) {
  UnconfirmedStretch stretch = stretch_of_here();
  for (unsigned seed = 1; seed <= 30; ++seed) {
    OdometryResult found = good_at(level_pose(200.0, 0.0, 0.0));
    EXPECT_EQ(
        stretch.evaluate(here().features(Eigen::Isometry3d::Identity(), 0.01, seed), {}, found),
        open);
  }
}

TEST(UnconfirmedStretch, SettlesOnceItsMotionWasSeenForLong) {
  UnconfirmedStretch followed = stretch_of_here();
  UnconfirmedStretch jumped = stretch_of_here();
  jump(jumped, 20.0);
  Decision last = open;
  for (unsigned k = 0; k < 100; ++k) {
    EXPECT_EQ(last, open) << k;
    const FeatureSets features = here().features(Eigen::Isometry3d::Identity(), 0.01, k);
    OdometryResult found = good_at(level_pose(200.0 + 2.0 * k, 0.0, 0.0));
    // What shows no motion is no part of the way.
    if (k >= 10 && k < 20) found.health = OdometryHealth::degenerate;
    OdometryResult same = found;
    EXPECT_NE(jumped.evaluate(features, {}, same), settled);
    last = followed.evaluate(features, {}, found);
    EXPECT_EQ(found.map_entry, last == settled ? MapEntry::enters_with_waiting : MapEntry::waits);
    if (last == settled) {
      EXPECT_EQ(k, 61U);
      break;
    }
  }
  EXPECT_EQ(last, settled);
}

TEST(UnconfirmedStretch, AJumpNearbyIsConfirmedByOneScanThatFitsAsUsual) {
  UnconfirmedStretch stretch = stretch_of_here();
  jump(stretch, 1.0);
  EXPECT_EQ(judged(stretch, here(), 1, 0.0, Eigen::Isometry3d::Identity()).back(), confirmed);
}

TEST(UnconfirmedStretch, AJumpFarOffIsConfirmedOnTheWayAlone) {
  UnconfirmedStretch stands = stretch_of_here();
  jump(stands, 20.0);
  const auto standing = judged(stands, here(), 30, 0.0, Eigen::Isometry3d::Identity());
  EXPECT_EQ(standing, std::vector<Decision>(30, open));
  UnconfirmedStretch drives = stretch_of_here();
  jump(drives, 20.0);
  const auto driving = judged(drives, here(), 30, 0.5, Eigen::Isometry3d::Identity());
  EXPECT_EQ(driving.back(), confirmed);
  EXPECT_EQ(driving.size(), 11U);
}

TEST(UnconfirmedStretch, AJumpToAPlaceThatScansDoNotAgreeOnIsGivenUp) {
  UnconfirmedStretch stretch = stretch_of_here();
  jump(stretch, 20.0);
  EXPECT_EQ(judged(stretch, here(), 30, 0.5, level_pose(0.5, 0.0, 0.0)).back(), contradicted);
}

TEST(UnconfirmedStretch, KnowsWhereMotionLedThroughItsJumps) {
  UnconfirmedStretch stretch = stretch_of_here();
  expect_near(stretch.where_motion_led(level_pose(4.0, 1.0, 0.2)), level_pose(4.0, 1.0, 0.2), 1e-9,
              1e-9);
  stretch.jump(level_pose(1.0, 0.0, 0.0), level_pose(1.0, 20.0, 0.5));
  expect_near(stretch.where_motion_led(level_pose(1.0, 20.0, 0.5) * level_pose(3.0, 0.0, 0.0)),
              level_pose(4.0, 0.0, 0.0), 1e-9, 1e-9);
  stretch.jump(level_pose(1.0, 20.0, 0.5) * level_pose(3.0, 0.0, 0.0), level_pose(0.0, 7.0, 0.0));
  expect_near(stretch.where_motion_led(level_pose(2.0, 7.0, 0.0)), level_pose(6.0, 0.0, 0.0), 1e-9,
              1e-9);
}

/// On a bridge no scan shows all of its motion: a small jump gave up all that was driven on it, and
/// the lidar was said to be where it drove on to it.
TEST(UnconfirmedStretch, AJumpNearbyIsNotGivenUpFarFromTheTrustedMap) {
  const auto last_of = [](double x_m) {
    UnconfirmedStretch stretch = stretch_of_here();
    jump(stretch, 0.6);
    Decision last = open;
    for (unsigned k = 0; k < 40 && last == open; ++k) {
      OdometryResult found = good_at(level_pose(x_m + k, 0.0, 0.0));
      found.health = OdometryHealth::degenerate;
      last = stretch.evaluate({}, {}, found);
    }
    return last;
  };
  EXPECT_EQ(last_of(60.0), open);
  EXPECT_EQ(last_of(0.0), contradicted);
}

}  // namespace
}  // namespace stillmap
