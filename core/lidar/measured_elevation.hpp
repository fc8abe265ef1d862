#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace stillmap {

/// Whether a point of a raw scan was measured: drivers put others at the origin, at NAN or, as REP
/// 117 has it of ranges, at infinity.
[[nodiscard]] inline bool is_measured(const Eigen::Vector3f& point_lidar) {
  constexpr float min_range_m = 0.1F;
  return point_lidar.squaredNorm() > min_range_m * min_range_m && point_lidar.allFinite();
}

/// Elevation of a point of a raw scan [rad]; NAN where it was not measured.
[[nodiscard]] inline double measured_elevation(const Eigen::Vector3f& point_lidar) {
  // atan2 would make an angle of two infinities.
  if (!is_measured(point_lidar)) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::Vector3d p = point_lidar.cast<double>();
  return std::atan2(p.z(), std::hypot(p.x(), p.y()));
}

}  // namespace stillmap
