#include <gtest/gtest.h>

#include <algorithm>

#include "core/odometry/odometry.hpp"
#include "tests/odometry/box_world.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap::test {
namespace {

/// Rows of parked cars across the way, of different sizes, and a lamp here and there.
BoxWorld car_park() {
  BoxWorld world;
  for (int row = -2; row <= 6; ++row)
    for (int bay = -14; bay <= 14; ++bay) {
      const double y = 2.7 * bay;
      if (std::abs(y) < 3.0 || (7 * row + 3 * bay) % 6 == 0) continue;
      const double longer_m = 0.1 * ((5 * row + bay) & 3);
      world.stand(11.0 * row + 0.2 * (bay & 1), y, {4.1 + longer_m, 1.8, 1.45 + longer_m},
                  SemanticClass::car);
    }
  for (const double x : {-15.0, 16.0, 48.0})
    world.stand(x, 4.0, {0.2, 0.2, 7.0}, SemanticClass::pole);
  return world;
}

/// The largest error of position of a lidar that sets off along x, by true labels [m].
double worst_error_m(const BoxWorld& world, Weighting weighting) {
  OdometryConfig config;
  config.weighting = weighting;
  Odometry odometry(config, test_lidar());
  double worst_m = 0.0;
  double x = 0.0;
  for (int k = 0; k < 30; ++k) {
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(x, 0.0, 0.0));
    const BoxScan seen = world.scan(test_lidar(), T_map_lidar, 0.1 * k);
    const OdometryResult found = register_scan(odometry, seen.scan, seen.labels()).result;
    worst_m =
        std::max(worst_m, (found.T_map_lidar.translation() - T_map_lidar.translation()).norm());
    if (x > 2.0) {
      EXPECT_EQ(found.health, OdometryHealth::good) << "scan " << k;
    }
    x += std::min(0.6, 0.04 * k);
  }
  return worst_m;
}

TEST(MovableWorld, ACarParkHoldsTheLidarThoughAllOfItCouldMove) {
  const double without_labels_m = worst_error_m(car_park(), Weighting::geometric);
  EXPECT_LT(without_labels_m, 0.05);
  EXPECT_LT(worst_error_m(car_park(), Weighting::semantic), without_labels_m + 0.02);
}

/// Between rows of lorries that drive as the lidar does, and little else.
TEST(MovableWorld, WhatDrivesAlongWithTheLidarIsNotCalledGood) {
  const double speed_m_s = 6.0;
  BoxWorld world;
  for (int k = -3; k <= 3; ++k)
    for (const double side : {-3.5, 3.5})
      world.stand(13.0 * k + side, side, {11.0, 2.5, 3.8}, SemanticClass::truck,
                  {speed_m_s, 0.0, 0.0});
  for (const double x : {-14.0, 20.0})
    world.stand(x, 0.0, {9.0, 2.5, 3.8}, SemanticClass::truck, {speed_m_s, 0.0, 0.0});
  for (int k = -2; k <= 5; ++k) world.stand(19.0 * k, 8.0, {0.3, 0.3, 6.0}, SemanticClass::pole);
  Odometry odometry(OdometryConfig{}, test_lidar());
  for (int k = 0; k < 25; ++k) {
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(0.1 * speed_m_s * k, 0.0, 0.0));
    const BoxScan seen = world.scan(test_lidar(), T_map_lidar, 0.1 * k);
    const OdometryResult found = register_scan(odometry, seen.scan, seen.labels()).result;
    const double off_m = (found.T_map_lidar.translation() - T_map_lidar.translation()).norm();
    EXPECT_FALSE(found.health == OdometryHealth::good && off_m > 0.5) << k << ": " << off_m << " m";
  }
}

/// A network that takes houses for lorries, and one that takes the road for one.
TEST(MovableWorld, OneClassThatIsTakenForVehiclesDoesNotMatter) {
  for (const auto wrong : {SemanticClass::building, SemanticClass::road}) {
    OdometryConfig config;
    Odometry odometry(config, test_lidar());
    const BoxWorld world = street();
    double worst_m = 0.0;
    for (int k = 0; k < 25; ++k) {
      const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(0.7 * k, 0.0, 0.0));
      BoxScan seen = world.scan(test_lidar(), T_map_lidar, 0.1 * k);
      std::ranges::replace(seen.scan.labels, wrong, SemanticClass::truck);
      const auto found = register_scan(odometry, seen.scan, seen.labels()).result.T_map_lidar;
      worst_m = std::max(worst_m, (found.translation() - T_map_lidar.translation()).norm());
    }
    EXPECT_LT(worst_m, 0.1) << name(wrong);
  }
}

}  // namespace
}  // namespace stillmap::test
