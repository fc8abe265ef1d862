#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "clients/commands/dataset/live_export.hpp"

namespace stillmap::cli {
namespace {

Scan scan_at(std::int64_t stamp_ns) {
  Scan scan;
  scan.stamp_ns = stamp_ns;
  scan.points_lidar.emplace_back(1.0F, 0.0F, 0.0F);
  return scan;
}

StampedPose pose_at(std::int64_t stamp_ns) {
  StampedPose pose{.stamp_ns = stamp_ns};
  pose.T_map_lidar.translation().x() = static_cast<double>(stamp_ns);
  return pose;
}

TEST(LiveScanSynchronizer, GivesAScanOnceItsPoseAndLabelsAreThereInWhateverOrder) {
  LiveScanSynchronizer scans;
  scans.add_labels(7, {SemanticClass::road});
  scans.add_pose(pose_at(7));
  EXPECT_FALSE(scans.take());
  scans.add_scan(scan_at(7));
  const auto live = scans.take();
  ASSERT_TRUE(live);
  EXPECT_EQ(live->scan.stamp_ns, 7);
  EXPECT_EQ(live->T_map_lidar.translation().x(), 7.0);
  EXPECT_EQ(live->classes.value().at(0), SemanticClass::road);
  EXPECT_FALSE(scans.take());
}

TEST(LiveScanSynchronizer, KeepsTheOrderOfTheSensor) {
  LiveScanSynchronizer scans;
  for (const std::int64_t stamp_ns : {1, 2}) scans.add_scan(scan_at(stamp_ns));
  scans.add_labels(2, {});
  scans.add_labels(1, {});
  scans.add_pose(pose_at(1));
  scans.add_pose(pose_at(2));
  EXPECT_EQ(scans.take().value().scan.stamp_ns, 1);
  EXPECT_EQ(scans.take().value().scan.stamp_ns, 2);
}

TEST(LiveScanSynchronizer, AScanThatTheServerDidNotMapIsLeftOutAndCounted) {
  LiveScanSynchronizer scans;
  for (const std::int64_t stamp_ns : {1, 2}) scans.add_scan(scan_at(stamp_ns));
  EXPECT_FALSE(scans.take());
  scans.add_labels(2, {});
  scans.add_pose(pose_at(2));
  EXPECT_EQ(scans.take().value().scan.stamp_ns, 2);
  EXPECT_EQ(scans.without_pose(), 1U);
}

TEST(LiveScanSynchronizer, WaitsForLabelsOnlySoLong) {
  LiveScanSynchronizer scans;
  scans.add_scan(scan_at(0));
  scans.add_pose(pose_at(0));
  for (std::int64_t later = 1; later < 10; ++later) scans.add_pose(pose_at(later));
  EXPECT_FALSE(scans.take());
  scans.add_pose(pose_at(10));
  const auto live = scans.take();
  ASSERT_TRUE(live);
  EXPECT_FALSE(live->classes);
}

TEST(LiveScanSynchronizer, AtTheEndTakesWhatThereIs) {
  LiveScanSynchronizer scans;
  for (const std::int64_t stamp_ns : {1, 2, 3}) scans.add_scan(scan_at(stamp_ns));
  scans.add_pose(pose_at(1));
  scans.add_pose(pose_at(2));
  EXPECT_EQ(scans.take_last().value().scan.stamp_ns, 1);
  EXPECT_EQ(scans.take_last().value().scan.stamp_ns, 2);
  EXPECT_FALSE(scans.take_last());
  EXPECT_EQ(scans.without_pose(), 1U);
}

TEST(LiveScanSynchronizer, DoesNotPileUpScansForAServerThatIsGone) {
  LiveScanSynchronizer scans;
  for (std::int64_t stamp_ns = 0; stamp_ns < 1000; ++stamp_ns) scans.add_scan(scan_at(stamp_ns));
  EXPECT_EQ(scans.without_pose(), 800U);
}

/// A turn of a VLP-16 in a room, and a point where the lidar's range ends and that of others not.
Scan turn_with_a_far_point() {
  Scan scan;
  for (int step = 0; step < 900; ++step) {
    for (int ring = 0; ring < 16; ++ring) {
      const double azimuth = step * 2.0 * std::numbers::pi / 900.0;
      const double elevation = (-15.0 + 2.0 * ring) * std::numbers::pi / 180.0;
      const double range = step == 7 && ring == 8 ? 110.0 : 8.0 + std::sin(azimuth);
      scan.points_lidar.push_back(
          (range * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                   std::cos(elevation) * std::sin(azimuth), std::sin(elevation)))
              .cast<float>());
      scan.ring.push_back(static_cast<std::uint16_t>(ring));
    }
  }
  return scan;
}

TEST(ServersPoints, AreThoseOfTheLidarThatADefaultServerRecognises) {
  const Scan scan = turn_with_a_far_point();
  ServersPoints points{ServerConfig{}};
  for (int again = 0; again < 2; ++again) {
    const auto ranges = points.ranges_for(scan, scan.size() - 1);
    ASSERT_TRUE(ranges);
    EXPECT_EQ(ranges->max_range_m, vlp_16().max_range_m);
    EXPECT_EQ(usable_points(scan, *ranges).size(), scan.size() - 1);
  }
  // Before the server has recognised it, and where its labels are of other points.
  EXPECT_TRUE(points.ranges_for(scan, scan.size()));
  EXPECT_FALSE(points.ranges_for(scan, scan.size() - 100));
}

TEST(ServersPoints, KeepTheRangesThatTheServersFileSays) {
  const Scan scan = turn_with_a_far_point();
  ServerConfig config;
  config.mapper.prepare.max_range_m = 50.0;
  config.automatic_sensor.sets_max_range = false;
  ServersPoints points(config);
  EXPECT_EQ(points.ranges_for(scan, scan.size() - 1).value().max_range_m, 50.0);
  EXPECT_FALSE(points.ranges_for(scan, scan.size()));
}

}  // namespace
}  // namespace stillmap::cli
