#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/odometry/odometry.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap::test {
namespace {

/// A scan at that time that shows nothing.
Scan empty_scan(double time_s) {
  Scan scan;
  scan.stamp_ns = std::llround(time_s * 1e9);
  return scan;
}

Eigen::Vector3d position_of(Odometry& odometry, Scan scan) {
  return register_scan(odometry, std::move(scan), {}).result.T_map_lidar.translation();
}

TEST(LostOnTheWay, ALidarThatStaysLostDoesNotGoBack) {
  const BoxSequence sequence(street(), 15);
  Odometry odometry(OdometryConfig{}, test_lidar());
  Eigen::Vector3d last_m = Eigen::Vector3d::Zero();
  for (int k = 0; k < 40; ++k) {
    const Eigen::Vector3d now_m = position_of(
        odometry, k < 15 ? sequence.scans[static_cast<std::size_t>(k)].scan : empty_scan(0.1 * k));
    EXPECT_LT((now_m - last_m).norm(), 1.0) << "scan " << k;
    last_m = now_m;
  }
}

/// A tunnel with smooth walls, and pillars where the lidar drives into it.
BoxWorld tunnel() {
  constexpr double height_m = 4.5;
  BoxWorld world;
  world.noise_m = 0.015;
  for (const double side : {-1.0, 1.0})
    world.stand(185.0, side * 4.0, {432.0, 1.0, height_m}, SemanticClass::building);
  for (int k = 0; k < 24; ++k)
    world.stand(-25.0 + 2.2 * k + 0.3 * (k % 5), k % 2 == 0 ? 2.7 : -2.8,
                {0.6 + 0.1 * (k % 4), 0.6, 2.8}, SemanticClass::building);
  return world;
}

/// What was known before the tunnel is out of reach by then: its smooth walls only look as those in
/// the tunnel do.
TEST(LostOnTheWay, ScansThatShowNothingDoNotTakeALidarBackToBeforeATunnel) {
  SensorModel lidar = vlp_16();
  lidar.columns = 900;
  const BoxWorld world = tunnel();
  Odometry odometry(OdometryConfig{}, lidar);
  double x_m = 0.0;
  Eigen::Vector3d last_m = Eigen::Vector3d::Zero();
  for (int k = 0; k < 110; ++k) {
    x_m += 1.2 * std::min(1.0, 0.05 * k);
    Scan scan =
        world.scan(lidar, Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.2, 0.0)), 0.1 * k).scan;
    scan.labels.clear();
    const bool is_empty = k == 98 || k == 99;
    const Eigen::Vector3d now_m =
        position_of(odometry, is_empty ? empty_scan(0.1 * k) : std::move(scan));
    EXPECT_LT((now_m - last_m).norm(), 3.0) << "scan " << k;
    last_m = now_m;
  }
}

}  // namespace
}  // namespace stillmap::test
