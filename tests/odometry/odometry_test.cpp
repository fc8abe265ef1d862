#include "core/odometry/odometry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <stdexcept>

#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap {
namespace {

using test::BoxSequence;
using test::BoxWorld;
using test::expect_near;
using test::level_pose;

OdometryConfig with_weighting(Weighting weighting) {
  OdometryConfig config;
  config.weighting = weighting;
  return config;
}

std::vector<OdometryResult> results(const BoxSequence& sequence, Odometry& odometry,
                                    bool with_labels) {
  std::vector<OdometryResult> all;
  for (const test::BoxScan& seen : sequence.scans)
    all.push_back(test::register_scan(odometry, seen.scan,
                                      with_labels ? seen.labels() : PointLabels{}, std::nullopt)
                      .result);
  return all;
}

/// Within 1 % of the 24 m driven.
void expect_follows(const BoxSequence& sequence, const std::vector<OdometryResult>& all) {
  ASSERT_EQ(all.size(), sequence.scans.size());
  EXPECT_EQ(all[0].health, OdometryHealth::initialised);
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k > 0) {
      EXPECT_EQ(all[k].health, OdometryHealth::good) << "scan " << k;
    }
    expect_near(all[k].T_map_lidar, sequence.T_map_lidar[k], 0.2, 0.01);
  }
}

class OdometrySequence : public ::testing::Test {
 protected:
  static const BoxSequence& quiet() {
    static const BoxSequence sequence(test::street(), 40);
    return sequence;
  }
};

TEST_F(OdometrySequence, FollowsTheTruthInEveryWeighting) {
  for (const Weighting mode : {Weighting::geometric, Weighting::semantic}) {
    Odometry odometry(with_weighting(mode), test::test_lidar());
    expect_follows(quiet(), results(quiet(), odometry, true));
  }
}

/// What lies far off counts in full, and some poses are doubted for it.
TEST_F(OdometrySequence, FollowsTheTruthNearlyWithoutWeights) {
  Odometry odometry(with_weighting(Weighting::none), test::test_lidar());
  const std::vector<OdometryResult> all = results(quiet(), odometry, true);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_NE(all[k].health, OdometryHealth::lost) << "scan " << k;
    expect_near(all[k].T_map_lidar, quiet().T_map_lidar[k], 0.4, 0.01);
  }
}

/// One scan of this street is all rings, on the road and on walls: those of the road lie where the
/// lidar is.
TEST_F(OdometrySequence, FewRingsFollowByWhateverTheyBegin) {
  Odometry begins_by_rings(OdometryConfig{}, test::test_lidar());
  OdometryConfig config;
  config.features.min_surface_rings = 8;
  Odometry by_surfaces(config, test::test_lidar());
  const auto error_m = [](const std::vector<OdometryResult>& all) {
    return (all.back().T_map_lidar.translation() - quiet().T_map_lidar.back().translation()).norm();
  };
  EXPECT_LT(error_m(results(quiet(), begins_by_rings, false)), 0.2);
  EXPECT_LT(error_m(results(quiet(), by_surfaces, false)), 0.2);
}

TEST_F(OdometrySequence, FollowsTheTruthWithoutLabels) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  expect_follows(quiet(), results(quiet(), odometry, false));
}

TEST_F(OdometrySequence, WithoutLabelsEveryPointIsStationary) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  const auto step =
      test::register_scan(odometry, quiet().scans[0].scan, PointLabels{}, std::nullopt);
  ASSERT_EQ(step.motion.size(), quiet().scans[0].scan.size());
  EXPECT_THAT(step.motion, ::testing::Each(Motion::stationary));
}

TEST_F(OdometrySequence, ResetStartsAnewAndRepeatsItselfToTheBit) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  const auto first = results(quiet(), odometry, true);
  odometry.reset();
  const auto second = results(quiet(), odometry, true);
  EXPECT_EQ(second[0].health, OdometryHealth::initialised);
  for (std::size_t k = 0; k < first.size(); ++k)
    EXPECT_EQ(first[k].T_map_lidar.matrix(), second[k].T_map_lidar.matrix()) << "scan " << k;
}

TEST_F(OdometrySequence, KeepsItsVelocityForAnotherMap) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  static_cast<void>(results(quiet(), odometry, true));
  const Eigen::Isometry3d motion = odometry.motion_during(0.1);
  const std::int64_t last_ns = quiet().scans.back().scan.stamp_ns;
  odometry.begin_map();
  // Another map at once.
  odometry.begin_map();
  expect_near(odometry.predict(last_ns + 100'000'000), Eigen::Isometry3d::Identity(), 1e-12, 1e-7);
  odometry.expect_first_scan(last_ns + 100'000'000);
  expect_near(odometry.motion_during(0.1), motion, 1e-12, 1e-7);
  Scan next = quiet().scans.back().scan;
  next.stamp_ns = last_ns + 100'000'000;
  const auto first = test::register_scan(odometry, next, quiet().scans.back().labels());
  EXPECT_EQ(first.result.health, OdometryHealth::initialised);
  expect_near(first.result.T_map_lidar, Eigen::Isometry3d::Identity(), 1e-12, 1e-7);
  expect_near(odometry.motion_during(0.1), motion, 1e-12, 1e-7);
}

TEST_F(OdometrySequence, ForgetsAVelocityOfAnotherTimeInAnotherMap) {
  const std::int64_t last_ns = quiet().scans.back().scan.stamp_ns;
  for (const std::int64_t stamp_ns : {std::int64_t{0}, last_ns, last_ns + 1'100'000'000}) {
    Odometry odometry(OdometryConfig{}, test::test_lidar());
    static_cast<void>(results(quiet(), odometry, true));
    odometry.begin_map();
    odometry.expect_first_scan(stamp_ns);
    expect_near(odometry.motion_during(0.1), Eigen::Isometry3d::Identity(), 1e-12, 1e-12);
  }
}

TEST_F(OdometrySequence, GoesOnAsItIsToldThatItMoved) {
  const Eigen::Isometry3d motion = level_pose(1.2, 0.0, 0.05);
  const StampedPose before_last{700'000'000, level_pose(3.0, 1.0, 0.3)};
  const auto motion_after = [&](std::int64_t last_ns, const Eigen::Isometry3d& moved,
                                std::int64_t first_scan_ns) {
    Odometry odometry(OdometryConfig{}, test::test_lidar());
    odometry.go_on_from(before_last, {last_ns, before_last.T_map_lidar * moved});
    // In the middle of its sweep.
    odometry.expect_first_scan(first_scan_ns + 50'000'000, 50'000'000);
    return odometry.motion_during(0.1);
  };
  expect_near(motion_after(800'000'000, motion, 900'000'000), motion, 1e-9, 1e-9);
  // A scan was left out.
  expect_near(motion_after(900'000'000, motion * motion, 1'000'000'000), motion, 1e-9, 1e-9);
  const auto nothing = Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d jump = level_pose(30.0, 0.0, 0.0);
  expect_near(motion_after(800'000'000, jump, 900'000'000), nothing, 1e-9, 1e-9);
  expect_near(motion_after(700'000'000, motion, 900'000'000), nothing, 1e-9, 1e-9);
  expect_near(motion_after(1'800'000'000, motion, 1'900'000'000), nothing, 1e-9, 1e-9);
  expect_near(motion_after(800'000'000, motion, 1'900'000'000), nothing, 1e-9, 1e-9);
  expect_near(motion_after(800'000'000, motion, 100'000'000), nothing, 1e-9, 1e-9);
}

TEST_F(OdometrySequence, KnowsItsOwnVelocityBetter) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  static_cast<void>(results(quiet(), odometry, true));
  const Eigen::Isometry3d motion = odometry.motion_during(0.1);
  odometry.begin_map();
  odometry.go_on_from({0, level_pose(0.0, 0.0, 0.0)}, {100'000'000, level_pose(2.0, 0.0, 0.1)});
  odometry.expect_first_scan(quiet().scans.back().scan.stamp_ns + 100'000'000);
  expect_near(odometry.motion_during(0.1), motion, 1e-12, 1e-7);
}

TEST_F(OdometrySequence, PredictsConstantVelocityUpToASecond) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  EXPECT_TRUE(odometry.motion_during(0.1).isApprox(Eigen::Isometry3d::Identity()));
  const auto all = results(quiet(), odometry, true);
  const Eigen::Isometry3d& last = all.back().T_map_lidar;
  const Eigen::Isometry3d motion = all[all.size() - 2].T_map_lidar.inverse() * last;
  const std::int64_t stamp_ns = quiet().scans.back().scan.stamp_ns;
  expect_near(odometry.motion_during(0.1), motion, 1e-6, 1e-6);
  expect_near(odometry.predict(stamp_ns + 100'000'000), last * motion, 1e-6, 1e-6);
  expect_near(odometry.predict(stamp_ns + 50'000'000), last * scaled_motion(motion, 0.5), 1e-6,
              1e-6);
  expect_near(odometry.predict(stamp_ns + 2'000'000'000), last, 1e-12, 1e-7);
}

TEST_F(OdometrySequence, GapInTimeIsBridgedWhereTheLidarStood) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  const BoxSequence before(test::street(), 10);
  (void)results(before, odometry, true);
  const double end_s = 0.1 * 9 + 3.0;
  const Eigen::Isometry3d T_true = before.T_map_lidar.back() * level_pose(0.3, 0.0, 0.01);
  const auto seen = test::street().scan(test::test_lidar(), T_true, end_s);
  const OdometryResult result =
      test::register_scan(odometry, seen.scan, seen.labels(), std::nullopt).result;
  EXPECT_EQ(result.health, OdometryHealth::good);
  expect_near(result.T_map_lidar, T_true, 0.1, 0.01);
}

TEST_F(OdometrySequence, PriorReplacesThePrediction) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  const Eigen::Isometry3d T_start = level_pose(5.0, -2.0, 1.2);
  const test::BoxScan& first = quiet().scans[0];
  const auto start = test::register_scan(odometry, first.scan, first.labels(), T_start);
  expect_near(start.result.T_map_lidar, T_start, 1e-12, 1e-7);

  // Four metres on at once: no velocity could know.
  const Eigen::Isometry3d T_moved = level_pose(4.0, 0.5, 0.1);
  const auto seen = test::street().scan(test::test_lidar(), T_moved, 0.1);
  const Eigen::Isometry3d T_true = T_start * T_moved;
  const auto step =
      test::register_scan(odometry, seen.scan, seen.labels(), T_true * level_pose(0.2, 0.1, 0.01));
  EXPECT_EQ(step.result.health, OdometryHealth::good);
  expect_near(step.result.T_map_lidar, T_true, 0.1, 0.01);
}

/// The prior of the first scan, as a mount gives it, tells which way is up: what is level by the
/// lidar's own axes are walls.
TEST(Odometry, FollowsALidarOnItsSideInALevelMap) {
  const BoxWorld world = test::street();
  SensorModel sensor = test::test_lidar();
  sensor.rings = 64;
  sensor.fov_up = 0.4;
  sensor.fov_down = -0.4;
  const Eigen::AngleAxisd R_level_lidar(0.5 * M_PI, Eigen::Vector3d::UnitX());
  Odometry odometry(OdometryConfig{}, sensor);
  for (int k = 0; k < 25; ++k) {
    const Eigen::Isometry3d T_map_lidar = BoxSequence::T_map_lidar_at(k) * R_level_lidar;
    const Scan scan = world.scan(sensor, T_map_lidar, 0.1 * k).scan;
    const auto prior = k == 0 ? std::optional(T_map_lidar) : std::nullopt;
    const OdometryResult result = test::register_scan(odometry, scan, PointLabels{}, prior).result;
    EXPECT_LE(result.health, OdometryHealth::good) << "scan " << k;
    expect_near(result.T_map_lidar, T_map_lidar, 0.05, 0.005);
  }
}

// A flash lidar, say, whose stamp is that of the message.
TEST_F(OdometrySequence, PosesAreAtTheStampWhenAllPointsAreOfAnotherTime) {
  for (const double late_scans : {0.5, -0.5}) {
    Odometry odometry(OdometryConfig{}, test::test_lidar());
    for (std::size_t k = 0; k < quiet().scans.size(); ++k) {
      Scan scan = quiet().scans[k].scan;
      scan.stamp_ns += std::llround(0.1e9 * late_scans);
      scan.time_offset_s.assign(scan.size(), static_cast<float>(-0.1 * late_scans));
      const auto step = odometry.register_scan(scan, sweep_times(scan, 0.1),
                                               quiet().scans[k].labels(), std::nullopt);
      // The first two do not know how the lidar moves.
      if (k < 2) continue;
      expect_near(step.result.T_map_lidar,
                  BoxSequence::T_map_lidar_at(static_cast<double>(k) + late_scans), 0.1, 0.01);
    }
  }
}

/// Poses at stamps `late_scans` after scans whose points were measured within `sweep_s`, in no
/// order.
std::vector<Eigen::Isometry3d> poses_of_short_sweeps(const BoxSequence& sequence, float sweep_s,
                                                     double late_scans) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  std::vector<Eigen::Isometry3d> poses;
  for (const test::BoxScan& seen : sequence.scans) {
    Scan scan = seen.scan;
    scan.stamp_ns += std::llround(0.1e9 * late_scans);
    for (std::size_t i = 0; i < scan.size(); ++i) {
      const auto part = static_cast<float>(i * 7919 % 1000) / 1000.0F - 0.5F;
      scan.time_offset_s.push_back(sweep_s * part - static_cast<float>(0.1 * late_scans));
    }
    const SweepTimes sweep = sweep_times(scan, 0.1);
    poses.push_back(
        odometry.register_scan(scan, sweep, seen.labels(), std::nullopt).result.T_map_lidar);
  }
  return poses;
}

// Points that differ by some milliseconds tell nothing of the tenth of a second to the stamp.
TEST_F(OdometrySequence, PosesAreAtTheStampWhenTheSweepIsShort) {
  constexpr std::size_t first = 3;
  for (const float sweep_s : {0.0005F, 0.004F}) {
    for (const double late_scans : {1.0, -1.0}) {
      const auto poses = poses_of_short_sweeps(quiet(), sweep_s, late_scans);
      const auto truth = [&](std::size_t k) {
        return BoxSequence::T_map_lidar_at(static_cast<double>(k) + late_scans);
      };
      for (std::size_t k = first + 1; k < poses.size(); ++k)
        expect_near(poses[first].inverse() * poses[k], truth(first).inverse() * truth(k), 0.15,
                    0.01);
    }
  }
}

TEST_F(OdometrySequence, FindsTheFirstMotionOfAFastStart) {
  // 54 km/h: farther in a scan than a plane's neighbours are looked for.
  for (const double ahead_m : {1.5, -1.5}) {
    Odometry odometry(OdometryConfig{}, test::test_lidar());
    const test::BoxScan& first = quiet().scans[0];
    (void)test::register_scan(odometry, first.scan, first.labels(), std::nullopt);
    const Eigen::Isometry3d T_true = level_pose(ahead_m, 0.0, 0.02);
    const auto seen = test::street().scan(test::test_lidar(), T_true, 0.1);
    const OdometryResult result =
        test::register_scan(odometry, seen.scan, seen.labels(), std::nullopt).result;
    EXPECT_EQ(result.health, OdometryHealth::good);
    expect_near(result.T_map_lidar, T_true, 0.1, 0.01);
  }
}

TEST_F(OdometrySequence, ScanWithoutFeaturesIsLostAtThePrediction) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  (void)results(BoxSequence(test::street(), 5), odometry, true);
  Scan blind;
  blind.stamp_ns = 500'000'000;
  blind.points_lidar.assign(200, Eigen::Vector3f(5.0F, 1.0F, 0.0F));
  blind.ring.assign(200, 3);
  const Eigen::Isometry3d predicted = odometry.predict(blind.stamp_ns);
  const OdometryResult result =
      test::register_scan(odometry, blind, PointLabels{}, std::nullopt).result;
  EXPECT_EQ(result.health, OdometryHealth::lost);
  expect_near(result.T_map_lidar, predicted, 1e-12, 1e-7);
}

TEST_F(OdometrySequence, TheCovarianceOfALostLidarGrowsWithTheTime) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  const OdometryResult known = results(quiet(), odometry, true).back();
  EXPECT_LT(known.covariance(0, 0), 0.01);
  Scan blind;
  blind.stamp_ns = quiet().scans.back().scan.stamp_ns;
  double last_m = 0.9;
  for (int k = 1; k <= 3; ++k) {
    blind.stamp_ns += 2'000'000'000;
    const OdometryResult lost =
        test::register_scan(odometry, blind, PointLabels{}, std::nullopt).result;
    ASSERT_EQ(lost.health, OdometryHealth::lost);
    // It drove at 6 m/s.
    const double sigma_m = std::sqrt(lost.covariance(0, 0));
    EXPECT_GT(sigma_m, last_m + 4.0);
    EXPECT_GT(lost.covariance(5, 5), 0.1);
    last_m = sigma_m;
  }
  // Stamps of years ahead give no absurd number.
  blind.stamp_ns += 4'000'000'000'000'000'000;
  const OdometryResult lost =
      test::register_scan(odometry, blind, PointLabels{}, std::nullopt).result;
  EXPECT_LT(std::sqrt(lost.covariance(0, 0)), 1010.0);
  EXPECT_LT(std::sqrt(lost.covariance(5, 5)), 2.0);
}

TEST_F(OdometrySequence, AFirstScanThatReplacesOneStaysOutOfTheMap) {
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  const test::BoxScan& seen_first = quiet().scans[0];
  const OdometryResult first =
      test::register_scan(odometry, seen_first.scan, seen_first.labels(), std::nullopt).result;
  ASSERT_EQ(first.health, OdometryHealth::initialised);
  EXPECT_TRUE(first.is_confirmed());
  // A street that stands on its side lies nowhere on that.
  const auto sideways = [&](std::size_t k) {
    const test::BoxScan& seen = quiet().scans[k];
    Scan scan = seen.scan;
    for (Eigen::Vector3f& p : scan.points_lidar) p = Eigen::Vector3f(p.z(), p.x(), p.y());
    return test::register_scan(odometry, scan, seen.labels(), std::nullopt).result;
  };
  OdometryResult found = sideways(1);
  for (std::size_t k = 2; k < 6 && found.health == OdometryHealth::lost; ++k) found = sideways(k);
  ASSERT_EQ(found.health, OdometryHealth::initialised);
  // Nobody knows where it is to the one before.
  EXPECT_FALSE(found.is_confirmed());
  EXPECT_GT(std::sqrt(found.covariance(0, 0)), 100.0);
}

/// The street, and cars that keep the lidar's pace beside and ahead of it.
BoxWorld street_with_convoy(std::initializer_list<double> lanes_y_m) {
  BoxWorld world = test::street();
  for (const double y : lanes_y_m)
    for (int k = -3; k <= 3; ++k)
      world.stand(8.0 * k + (y == 0.0 ? 4.5 : 3.0), y, test::car_size_m, SemanticClass::car,
                  {6.0, 0.0, 0.0});
  return world;
}

TEST(OdometryInTraffic, AConvoyDoesNotTakeItAlong) {
  const BoxSequence round_it(street_with_convoy({-3.2, 0.0, 3.2}), 15);
  const BoxSequence beside_it(street_with_convoy({-3.2}), 15);
  for (const auto& [sequence, with_labels] : {std::pair(&round_it, true), {&beside_it, false}}) {
    Odometry odometry(OdometryConfig{}, test::test_lidar());
    const std::vector<OdometryResult> all = results(*sequence, odometry, with_labels);
    for (std::size_t k = 0; k < all.size(); ++k)
      expect_near(all[k].T_map_lidar, sequence->T_map_lidar[k], 0.3, 0.02);
  }
}

TEST(OdometryInTraffic, SurvivesAWholeClassOfWrongLabels) {
  const BoxSequence sequence(street_with_convoy({-3.2}), 15);
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  for (std::size_t k = 0; k < sequence.scans.size(); ++k) {
    const test::BoxScan& seen = sequence.scans[k];
    PointLabels labels = seen.labels();
    for (SemanticClass& label : labels.classes)
      if (label == SemanticClass::building) label = SemanticClass::car;
    const OdometryResult result =
        test::register_scan(odometry, seen.scan, labels, std::nullopt).result;
    expect_near(result.T_map_lidar, sequence.T_map_lidar[k], 0.3, 0.02);
  }
}

TEST(OdometryInTraffic, FindsTheMovingCarsAndFollowsTheTruth) {
  const BoxSequence sequence(test::street_with_traffic(), 40);
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  double found = 0.0, missed = 0.0, wrong = 0.0;
  for (std::size_t k = 0; k < sequence.scans.size(); ++k) {
    const test::BoxScan& seen = sequence.scans[k];
    const auto step = test::register_scan(odometry, seen.scan, seen.labels(), std::nullopt);
    expect_near(step.result.T_map_lidar, sequence.T_map_lidar[k], 0.2, 0.01);
    if (k < 10) continue;
    for (std::size_t i = 0; i < seen.scan.size(); ++i) {
      const bool flagged = step.motion[i] == Motion::highly_dynamic;
      found += flagged && seen.moves[i] ? 1.0 : 0.0;
      missed += !flagged && seen.moves[i] ? 1.0 : 0.0;
      wrong += flagged && !seen.moves[i] ? 1.0 : 0.0;
      if (!is_movable(seen.scan.labels[i])) {
        ASSERT_EQ(step.motion[i], Motion::stationary);
      }
    }
  }
  EXPECT_GT(found / (found + missed), 0.9);
  EXPECT_GT(found / (found + wrong), 0.9);
}

}  // namespace
}  // namespace stillmap
