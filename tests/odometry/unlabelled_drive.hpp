#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

#include "core/odometry/odometry.hpp"
#include "tests/odometry/box_world.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap::test {

/// Follows a lidar without labels by its geometry, ten scans a second, and ends where it is lost.
/// `T_world_lidar(k)` is where it is at scan k; `check` gets what the pose that was found is off
/// that, in the lidar's frame.
template <typename Motion, typename Check>
void follow_unlabelled(const BoxWorld& world, const SensorModel& sensor, int scans,
                       const Motion& T_world_lidar, const Check& check) {
  OdometryConfig config;
  config.weighting = Weighting::geometric;
  Odometry odometry(config, sensor);
  const Eigen::Isometry3d T_map_world = T_world_lidar(0).inverse();
  for (int k = 0; k < scans; ++k) {
    SCOPED_TRACE("scan " + std::to_string(k));
    Scan scan = world.scan(sensor, T_world_lidar(k), 0.1 * k).scan;
    scan.labels.clear();
    const OdometryResult found = register_scan(odometry, std::move(scan), {}).result;
    ASSERT_NE(found.health, OdometryHealth::lost);
    check(Eigen::Isometry3d((T_map_world * T_world_lidar(k)).inverse() * found.T_map_lidar));
  }
}

/// Where a lidar is at scan k that sets off along x, and has its speed after a second.
inline Eigen::Isometry3d setting_off(int k, double speed_m_s) {
  const int gaining = std::min(k, 10);
  const double at_full_speed_s = 0.05 * 0.1 * gaining * (gaining + 1) + 0.1 * (k - gaining);
  return Eigen::Isometry3d(Eigen::Translation3d(speed_m_s * at_full_speed_s, 0.0, 0.0));
}

}  // namespace stillmap::test
