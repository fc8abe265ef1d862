#include <gtest/gtest.h>

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

}  // namespace
}  // namespace stillmap::cli
