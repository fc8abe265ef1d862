#include "core/odometry/fit_statistics.hpp"

#include <gtest/gtest.h>

#include "core/odometry/pose_search.hpp"

namespace stillmap {
namespace {

/// A scan that fits, which its points would move so far along the map's x.
OdometryResult scan_moved_by(double x_m) {
  OdometryResult result;
  result.health = OdometryHealth::good;
  result.fit = 0.9;
  result.upright_fit = 0.8;
  result.overlap = 1.0;
  result.point_deviation_m = {x_m, 0.0, 0.0};
  return result;
}

FitStatistics statistics_after(int scans) {
  FitStatistics fits;
  for (int k = 0; k < scans; ++k) fits.add(scan_moved_by(0.0));
  return fits;
}

TEST(FitStatistics, PointsContradictWhereTheyGoTheSameWayAgainAndAgain) {
  FitStatistics fits = statistics_after(20);
  int scans = 0;
  for (; scans < 10 && !fits.is_contradicted_by_points(scan_moved_by(0.12)); ++scans)
    fits.add(scan_moved_by(0.12));
  EXPECT_GT(scans, 0);
  EXPECT_LE(scans, 2);
}

TEST(FitStatistics, PointsThatAreScatteredDoNotContradict) {
  FitStatistics fits = statistics_after(20);
  for (int k = 0; k < 20; ++k) {
    const OdometryResult scan = scan_moved_by(k % 2 == 0 ? 0.12 : -0.12);
    EXPECT_FALSE(fits.is_contradicted_by_points(scan)) << "scan " << k;
    fits.add(scan);
  }
}

TEST(FitStatistics, OneScanThatIsFarOffDoesNotMakeTheNextOnesDoubtful) {
  FitStatistics fits = statistics_after(20);
  EXPECT_FALSE(fits.is_contradicted_by_points(scan_moved_by(1.0)));
  fits.add(scan_moved_by(1.0));
  EXPECT_FALSE(fits.is_contradicted_by_points(scan_moved_by(0.04)));
  fits.add(scan_moved_by(1.0));
  EXPECT_TRUE(fits.is_contradicted_by_points(scan_moved_by(1.0)));
  fits.forget_point_deviation();
  EXPECT_FALSE(fits.is_contradicted_by_points(scan_moved_by(0.12)));
}

TEST(FitStatistics, FewScansAreNoReasonToDoubt) {
  FitStatistics fits;
  fits.add(scan_moved_by(0.3));
  EXPECT_FALSE(fits.is_contradicted_by_points(scan_moved_by(0.3)));
  EXPECT_TRUE(fits.believes(scan_moved_by(0.3)));
}

TEST(FitStatistics, ALostScanTellsNothing) {
  FitStatistics fits = statistics_after(20);
  OdometryResult lost = scan_moved_by(5.0);
  lost.health = OdometryHealth::lost;
  fits.add(lost);
  EXPECT_FALSE(fits.is_contradicted_by_points(scan_moved_by(0.0)));
}

// The first scan of another city that was put in the place of a drive's own fitted like this.
TEST(FitStatistics, MotionVouchesForAPoorFitOnlyWhereItLed) {
  const FitStatistics fits = statistics_after(20);
  PosePrediction prediction{.is_known = true};
  OdometryResult found = scan_moved_by(0.0);
  found.fit = 0.6;
  found.upright_fit = 0.42;
  ASSERT_TRUE(fits.believes(found));
  EXPECT_FALSE(is_unvouched(found, prediction, fits));
  found.T_map_lidar.translation().x() = 0.3;
  EXPECT_TRUE(is_unvouched(found, prediction, fits));
  prediction.is_prior = true;
  EXPECT_FALSE(is_unvouched(found, prediction, fits));
  prediction.is_prior = false;
  found.upright_fit = 0.6;
  EXPECT_FALSE(is_unvouched(found, prediction, fits)) << "what stands up fits";
  found.upright_fit = 0.42;
  found.fit = 0.8;
  EXPECT_FALSE(is_unvouched(found, prediction, fits)) << "the whole fits";
}

}  // namespace
}  // namespace stillmap
