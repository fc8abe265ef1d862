#include "core/geodesy/gnss_track.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

using testing::HasSubstr;

constexpr std::int64_t second_ns = 1'000'000'000;
const EastNorthUp earth(49.0, 8.4, 115.0);
const Eigen::Vector3d antenna_lidar(0.5, -0.2, 1.0);

/// A robot that drives 10 m/s east and turns left.
Eigen::Isometry3d T_odom_lidar_at(double time_s) {
  return Eigen::Translation3d(10.0 * time_s, 0.0, 0.0) *
         Eigen::AngleAxisd(0.1 * time_s, Eigen::Vector3d::UnitZ());
}

GnssFix fix_at(double time_s, double sigma_m = 0.5) {
  GnssFix fix = earth.fix_at(T_odom_lidar_at(time_s) * antenna_lidar);
  fix.stamp_ns = std::llround(time_s * 1e9);
  fix.covariance_enu = Eigen::Vector3d::Constant(sigma_m * sigma_m).asDiagonal();
  return fix;
}

class GnssTracks : public testing::Test {
 protected:
  void scan(std::size_t number, double time_s) {
    track_.add_scan(number, std::llround(time_s * 1e9), T_odom_lidar_at(time_s), antenna_lidar);
  }

  GnssTrack track_{GnssConfig{}};
};

TEST_F(GnssTracks, AFixIsPutBetweenTheScansAroundIt) {
  scan(0, 0.0);
  scan(1, 0.1);
  EXPECT_EQ(track_.add(fix_at(0.03)), "");
  const auto placed = track_.take();
  ASSERT_EQ(placed.size(), 1U);
  EXPECT_EQ(placed[0].scan, 1U);
  const Eigen::Vector3d antenna_odom = T_odom_lidar_at(0.1) * placed[0].antenna_lidar;
  EXPECT_LT((antenna_odom - T_odom_lidar_at(0.03) * antenna_lidar).norm(), 1e-3);
  EXPECT_LT(placed[0].position_enu.norm(), 1e-6) << "the first fix is the origin";
  EXPECT_TRUE(track_.take().empty()) << "each once";
  EXPECT_EQ(track_.placed(), 1U);
}

TEST_F(GnssTracks, FixesWaitForTheScanAfterThemAndMayComeLate) {
  scan(0, 0.0);
  ASSERT_EQ(track_.add(fix_at(0.05)), "");
  EXPECT_TRUE(track_.take().empty());
  for (std::size_t k = 1; k <= 30; ++k) scan(k, 0.1 * static_cast<double>(k));
  ASSERT_EQ(track_.add(fix_at(1.0)), "");
  const auto placed = track_.take();
  ASSERT_EQ(placed.size(), 2U);
  EXPECT_EQ(placed[0].scan, 1U);
  EXPECT_EQ(placed[1].scan, 10U);
  EXPECT_LT((placed[1].antenna_lidar - antenna_lidar).norm(), 1e-9) << "of the scan's own time";
}

TEST_F(GnssTracks, WhereNoScansLieAroundItAFixIsNotUsed) {
  scan(0, 10.0);
  ASSERT_EQ(track_.add(fix_at(9.0)), "");
  EXPECT_TRUE(track_.take().empty());
  scan(1, 15.0);
  ASSERT_EQ(track_.add(fix_at(12.0)), "");
  EXPECT_TRUE(track_.take().empty()) << "nobody knows how it drove for 5 s";
  EXPECT_EQ(track_.misplaced(), 2U);
}

TEST_F(GnssTracks, AStandingRobotHasGapsThatDoNotMatter) {
  const Eigen::Isometry3d T = T_odom_lidar_at(1.0);
  track_.add_scan(0, 0, T, antenna_lidar);
  track_.add_scan(1, 100 * second_ns, T, antenna_lidar);
  ASSERT_EQ(track_.add(fix_at(50.0)), "");
  ASSERT_EQ(track_.take().size(), 1U);
}

TEST_F(GnssTracks, AClockThatIsSetBackDropsWhatWaits) {
  scan(0, 100.0);
  ASSERT_EQ(track_.add(fix_at(200.0)), "");
  scan(1, 5.0);
  scan(2, 5.1);
  ASSERT_EQ(track_.add(fix_at(5.05)), "");
  const auto placed = track_.take();
  ASSERT_EQ(placed.size(), 1U);
  EXPECT_EQ(placed[0].scan, 2U);
  EXPECT_EQ(track_.misplaced(), 1U);
}

TEST_F(GnssTracks, RefusesBadFixesAndBelievesNoneTooMuch) {
  EXPECT_THAT(track_.add(fix_at(0.0, 50.0)), HasSubstr("50.000000 m"));
  GnssFix fix = fix_at(0.0);
  fix.latitude_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(track_.add(fix), HasSubstr("latitude"));
  EXPECT_FALSE(track_.enu());
  scan(0, 0.0);
  ASSERT_EQ(track_.add(fix_at(0.0, 0.0)), "") << "a receiver that says it errs by nothing";
  fix = fix_at(0.0);
  fix.altitude_m = std::numeric_limits<double>::quiet_NaN();
  ASSERT_EQ(track_.add(fix), "");
  fix = fix_at(0.0);
  fix.covariance_enu(2, 2) = 1e300;
  ASSERT_EQ(track_.add(fix), "");
  const auto placed = track_.take();
  ASSERT_EQ(placed.size(), 3U);
  EXPECT_NEAR(placed[0].covariance_enu(0, 0), 0.02 * 0.02, 1e-12);
  for (std::size_t k = 1; k < 3; ++k) {
    EXPECT_TRUE(placed[k].position_enu.allFinite());
    EXPECT_NEAR(placed[k].covariance_enu(2, 2), 1e8, 1.0) << "nothing is known of its height";
    EXPECT_TRUE(placed[k].covariance_enu.inverse().allFinite());
  }
}

TEST_F(GnssTracks, WithoutScansItDoesNotGrow) {
  for (int k = 0; k < 7000; ++k) ASSERT_EQ(track_.add(fix_at(k)), "");
  EXPECT_EQ(track_.misplaced(), 2000U);
}

/// Another fix than that, near where the equator and the meridian of Greenwich meet.
GnssFix elsewhere(GnssFix fix) {
  fix.latitude_deg = 0.001;
  fix.longitude_deg = 0.0;
  return fix;
}

TEST_F(GnssTracks, AFirstFixOfAnotherPlaceIsTheOriginUntilOthersContradictIt) {
  scan(0, 0.0);
  ASSERT_EQ(track_.add(elsewhere(fix_at(0.05))), "");
  std::vector<PositionAtScan> placed;
  for (std::size_t k = 1; k <= 10; ++k) {
    const double time_s = 0.1 * static_cast<double>(k);
    ASSERT_EQ(track_.add(fix_at(time_s - 0.05)), "");
    EXPECT_EQ(track_.origins(), k < 5 ? 1U : 2U) << "five say it together";
    scan(k, time_s);
    placed = track_.take();
  }
  EXPECT_NEAR(track_.enu()->fix_at(Eigen::Vector3d::Zero()).latitude_deg, 49.0, 1e-3);
  ASSERT_EQ(placed.size(), 1U);
  const Eigen::Vector3d expected =
      T_odom_lidar_at(0.95) * antenna_lidar - T_odom_lidar_at(0.05) * antenna_lidar;
  EXPECT_LT((placed[0].position_enu - expected).norm(), 1e-3) << "about the first of the others";
}

TEST_F(GnssTracks, WhatWaitsOfAnotherPlaceIsDropped) {
  ASSERT_EQ(track_.add(elsewhere(fix_at(0.05))), "");
  for (int k = 1; k <= 5; ++k) ASSERT_EQ(track_.add(fix_at(0.05 + 0.001 * k)), "");
  EXPECT_EQ(track_.misplaced(), 1U);
  scan(0, 0.0);
  scan(1, 0.1);
  const auto placed = track_.take();
  ASSERT_EQ(placed.size(), 5U);
  for (const PositionAtScan& position : placed) EXPECT_LT(position.position_enu.norm(), 1.0);
}

TEST_F(GnssTracks, FewerStraysThanBelievedFixesMoveNothing) {
  for (int k = 0; k < 10; ++k) ASSERT_EQ(track_.add(fix_at(k)), "");
  for (int k = 10; k < 20; ++k) ASSERT_EQ(track_.add(elsewhere(fix_at(k))), "");
  EXPECT_EQ(track_.origins(), 1U);
  ASSERT_EQ(track_.add(fix_at(20.0)), "");
  // Each of another place than the one before: what they have in common is that they err.
  for (int k = 0; k < 50; ++k) {
    GnssFix stray = fix_at(21.0 + k);
    stray.latitude_deg = k % 2 == 0 ? 10.0 : -10.0;
    ASSERT_EQ(track_.add(stray), "");
  }
  EXPECT_EQ(track_.origins(), 1U);
}

TEST_F(GnssTracks, ALongDriveKeepsItsOrigin) {
  constexpr double spacing_m = 1000.0;
  for (int k = 0; k < 300; ++k) {
    GnssFix fix = earth.fix_at({spacing_m * k, 0.0, 0.0});
    fix.stamp_ns = k * 10 * second_ns;
    ASSERT_EQ(track_.add(fix), "");
  }
  EXPECT_EQ(track_.origins(), 1U);
}

/// The same robot, which stands for 5 s of every 20.
double driving_s(double time_s) {
  const double lap = std::floor(time_s / 20.0);
  return 15.0 * lap + std::min(15.0, time_s - 20.0 * lap);
}

TEST(GnssTrack, StampsThatAreLateArePutRight) {
  GnssTrack track{GnssConfig{}};
  GnssTrack told{GnssConfig{.delay_s = 0.4}};
  bool is_judged = false;
  double worst_m = 0.0, told_m = 0.0;
  for (std::size_t k = 0; k < 1000; ++k) {
    const double time_s = 0.1 * static_cast<double>(k);
    GnssFix fix = fix_at(driving_s(time_s - 0.02), 0.02);
    fix.stamp_ns = std::llround((time_s + 0.38) * 1e9);
    for (GnssTrack* const one : {&track, &told}) {
      ASSERT_EQ(one->add(fix), "");
      one->add_scan(k, std::llround(time_s * 1e9), T_odom_lidar_at(driving_s(time_s)),
                    antenna_lidar);
    }
    is_judged |= track.judge_delay();
    EXPECT_FALSE(told.judge_delay());
    const auto error_m = [](const GnssTrack& one, const PositionAtScan& position) {
      const double scan_s = 0.1 * static_cast<double>(position.scan);
      const Eigen::Vector3d antenna_odom =
          T_odom_lidar_at(driving_s(scan_s)) * position.antenna_lidar;
      const Eigen::Vector3d heard_odom =
          position.position_enu + earth.position_enu(one.enu()->fix_at(Eigen::Vector3d::Zero()));
      return (antenna_odom - heard_odom).norm();
    };
    for (const auto& position : track.take())
      if (is_judged) worst_m = std::max(worst_m, error_m(track, position));
    for (const auto& position : told.take()) told_m = std::max(told_m, error_m(told, position));
  }
  EXPECT_TRUE(is_judged);
  EXPECT_NEAR(track.delay().delay_s, 0.4, 0.01);
  EXPECT_LT(worst_m, 0.5);
  EXPECT_LT(told_m, 0.5);
}

/// Whether a delay is found of a robot that first stands, then goes straight, then turns and stops.
bool finds_delay_after(int standing_scans, int straight_scans) {
  GnssTrack track{GnssConfig{}};
  const int turning_scans = 1000;
  for (int k = -standing_scans; k < straight_scans + turning_scans; ++k) {
    const double time_s = 0.1 * k, straight_s = 0.1 * straight_scans;
    const auto T_at = [&](double s) -> Eigen::Isometry3d {
      const double east_m = std::clamp(s, 0.0, straight_s);
      return Eigen::Translation3d(east_m, 0.0, 0.0) *
             T_odom_lidar_at(driving_s(std::max(s - straight_s, 0.0)));
    };
    if (k % 20 == 0 || k > straight_scans) {
      GnssFix fix = earth.fix_at(T_at(time_s) * antenna_lidar);
      fix.stamp_ns = std::llround((time_s + 0.4) * 1e9);
      fix.covariance_enu = Eigen::Vector3d::Constant(0.02 * 0.02).asDiagonal();
      EXPECT_EQ(track.add(fix), "");
    }
    track.add_scan(static_cast<std::size_t>(k + standing_scans), std::llround(time_s * 1e9),
                   T_at(time_s), antenna_lidar);
    static_cast<void>(track.take());
  }
  return track.judge_delay(true);
}

// Positions of what is no longer kept could not be had again by another delay.
TEST(GnssTrack, TheDelayStaysOnceTheBeginningOfTheWayIsForgotten) {
  EXPECT_TRUE(finds_delay_after(0, 2000));
  EXPECT_FALSE(finds_delay_after(0, 51'000));
  EXPECT_TRUE(finds_delay_after(51'000, 2000)) << "there was no way before";
}

}  // namespace
}  // namespace stillmap
