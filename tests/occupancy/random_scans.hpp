#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap::test {

struct PlacedScan {
  LabelledScan scan;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
};

/// Points all round a lidar near the origin, up to `range_m` away; some of each motion.
[[nodiscard]] PlacedScan random_scan(std::uint32_t seed, int points, double range_m);

/// A scan of one point (lidar frame [m]).
[[nodiscard]] LabelledScan one_point(const Eigen::Vector3f& p_lidar,
                                     Motion motion = Motion::stationary);

}  // namespace stillmap::test
