#pragma once

#include "core/odometry/odometry.hpp"

namespace stillmap::test {

/// Registers a scan that was taken in one instant.
inline Odometry::Step register_scan(
    Odometry& odometry, Scan scan, const PointLabels& labels,
    const std::optional<Eigen::Isometry3d>& T_map_lidar_prior = std::nullopt) {
  return odometry.register_scan(scan, SweepTimes{}, labels, T_map_lidar_prior);
}

}  // namespace stillmap::test
