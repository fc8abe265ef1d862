#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "core/dataset/scan_dataset.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

Mapper geometric_mapper() {
  MapperConfig config;
  config.sensor = hdl_64e();
  return {config, std::make_unique<NullSegmenter>()};
}

Scan scan_of(const ScanDataset& sequence, std::size_t k) {
  Scan scan = sequence.read(k).scan;
  scan.stamp_ns = sequence.stamp_ns(k);
  return scan;
}

/// A real street (KITTI raw, drive 0005): every second scan makes the map, the ones between have to
/// find their place in it, without any class to help.
TEST(ResumedMap, ScansThatAreNotInItFindTheirPlace) {
  const char* recordings = std::getenv("STILLMAP_TEST_DATA");
  if (recordings == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
  const auto folder = std::filesystem::path(recordings) / "kitti_raw_0005";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const ScanDataset sequence{folder};
  Mapper maker = geometric_mapper();
  Mapper follower = geometric_mapper();
  std::vector<Eigen::Isometry3d> T_map_lidar;
  for (std::size_t k = 0; k < sequence.size(); ++k) {
    if (k % 2 == 0) (void)maker.process(scan_of(sequence, k));
    T_map_lidar.push_back(follower.process(scan_of(sequence, k)).value().odometry.T_map_lidar);
  }
  int found = 0;
  int tried = 0;
  for (std::size_t k = 5; k < sequence.size(); k += 20) {
    for (const auto& guess : {test::level_pose(0.5, 0.3, 0.05), test::level_pose(3.0, -2.0, 0.4),
                              test::level_pose(-5.0, 2.0, -2.0)}) {
      Mapper mapper = geometric_mapper();
      mapper.resume(*maker.map_snapshot());
      const auto began = std::chrono::steady_clock::now();
      const auto mapped = mapper.process(scan_of(sequence, k), T_map_lidar[k] * guess);
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
      const Eigen::Isometry3d& T = mapped.value().odometry.T_map_lidar;
      const double off_m = test::translation_error(T, T_map_lidar[k]);
      const bool is_found = mapped->odometry.health == OdometryHealth::good && off_m < 0.3;
      EXPECT_TRUE(is_found || mapped->odometry.health == OdometryHealth::lost)
          << "scan " << k << " is " << off_m << " m off";
      found += is_found ? 1 : 0;
      ++tried;
      std::cout << k << ": " << name(mapped->odometry.health) << ", " << off_m << " m, "
                << test::rotation_error(T, T_map_lidar[k]) << " rad, " << took.count() << " s\n";
    }
  }
  EXPECT_GE(found, tried * 9 / 10) << "of " << tried;
}

}  // namespace
}  // namespace stillmap
