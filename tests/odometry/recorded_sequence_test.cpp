#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/rings.hpp"
#include "core/odometry/odometry.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap {
namespace {

/// The first scans of KITTI's odometry sequence 00: a car at some 8 m/s in a street. Its true poses
/// are wrong by decimetres there, so they are not looked at.
TEST(RecordedSequence, IsNeverLostAndMovesAsACarDoes) {
  const char* folder = std::getenv("STILLMAP_TEST_DATA");
  if (folder == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA does not name the test recordings";
  const ScanDataset recording(std::filesystem::path(folder) / "kitti_odom_00");
  const SensorModel sensor = hdl_64e();
  Odometry odometry(OdometryConfig{}, sensor);
  Eigen::Isometry3d T_map_last = Eigen::Isometry3d::Identity();
  for (std::size_t k = 0; k < recording.size(); ++k) {
    Scan scan = recording.read(k).scan;
    scan.stamp_ns = recording.stamp_ns(k);
    scan.ring = assign_rings(scan, sensor);
    scan = drop_unusable_points(std::move(scan), PrepareConfig{});
    const OdometryResult result =
        test::register_scan(odometry, scan, PointLabels{}, std::nullopt).result;
    EXPECT_EQ(result.health, k == 0 ? OdometryHealth::initialised : OdometryHealth::good) << k;
    EXPECT_LT(test::translation_error(result.T_map_lidar, T_map_last), 2.0) << k;
    EXPECT_LT(test::rotation_error(result.T_map_lidar, T_map_last), 0.1) << k;
    T_map_last = result.T_map_lidar;
  }
  EXPECT_GT(T_map_last.translation().norm(), 5.0) << "the car drove";
}

}  // namespace
}  // namespace stillmap
