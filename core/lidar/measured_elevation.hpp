#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace stillmap {

/// Elevation of a point of a raw scan [rad]. NAN where nothing was measured: drivers put such
/// points at the origin, at NAN or, as REP 117 has it of ranges, at infinity.
[[nodiscard]] inline double measured_elevation(const Eigen::Vector3f& point_lidar) {
  constexpr float min_range_m = 0.1F;
  // Written so that NAN fails. atan2 would make an angle of two infinities.
  const bool is_measured =
      point_lidar.squaredNorm() > min_range_m * min_range_m && point_lidar.allFinite();
  if (!is_measured) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::Vector3d p = point_lidar.cast<double>();
  return std::atan2(p.z(), std::hypot(p.x(), p.y()));
}

}  // namespace stillmap
