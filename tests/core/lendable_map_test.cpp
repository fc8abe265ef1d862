#include "core/lendable_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <memory>

namespace stillmap {
namespace {

constexpr double degree = 0.017453292519943295;

/// Rays of a 64-beam lidar ahead, which hit a wall, or something before it.
LabelledScan looking_ahead(std::int64_t stamp_ns, bool is_something_there) {
  LabelledScan scan;
  scan.scan.stamp_ns = stamp_ns;
  for (int ring = 0; ring < 30; ++ring) {
    for (int column = 0; column < 100; ++column) {
      const double elevation = (-10.0 + 0.4 * ring) * degree;
      const double azimuth = (-10.0 + 0.2 * column) * degree;
      const bool is_before_wall = is_something_there && std::abs(azimuth) < 6.0 * degree;
      const double range_m = is_before_wall ? 10.0 : 20.0;
      scan.scan.points_lidar.push_back(
          (range_m * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                     std::cos(elevation) * std::sin(azimuth), std::sin(elevation)))
              .cast<float>());
    }
  }
  scan.motion.assign(scan.scan.size(), Motion::stationary);
  return scan;
}

/// Voxels after a lidar saw something that is gone by the last scans, which come in late: before
/// that another lidar was told, or not.
std::size_t voxels_after(bool is_other_told, bool wait) {
  LendableMap map({}, hdl_64e());
  std::int64_t stamp_ns = 0;
  const auto at_origin = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 30; ++i) map.insert(looking_ahead(++stamp_ns, true), at_origin);
  static_cast<void>(map.lend());
  for (int i = 0; i < 60; ++i) {
    Eigen::Isometry3d T_map_lidar = at_origin;
    // Those that wait must be some way apart.
    if (wait) T_map_lidar.translation().x() = -0.5 * i;
    if (wait) {
      map.let_wait(looking_ahead(++stamp_ns, false), T_map_lidar);
    } else {
      map.insert(looking_ahead(++stamp_ns, false), T_map_lidar);
    }
  }
  // One that looks steeply down.
  SensorModel other = hdl_64e();
  other.fov_up = -40.0 * degree;
  other.fov_down = -65.0 * degree;
  if (is_other_told) map.use_sensor(other);
  map.reclaim();
  map.insert_kept();
  static_cast<void>(map.decide_waiting(MapEntry::enters_with_waiting, false));
  return map.map().view()->tiles.voxel_count();
}

TEST(LendableMap, ScansThatAreKeptAreOfTheLidarThatTookThem) {
  for (const bool wait : {false, true})
    EXPECT_EQ(voxels_after(true, wait), voxels_after(false, wait));
}

}  // namespace
}  // namespace stillmap
