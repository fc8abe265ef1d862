#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

namespace stillmap {

/// Where a receiver says that its antenna is on the earth (WGS 84).
struct GnssFix {
  /// Nanoseconds since the Unix epoch (or since the start of the dataset), as scans have it.
  std::int64_t stamp_ns = 0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  /// Above the ellipsoid [m]; NaN where the receiver does not know it.
  double altitude_m = 0.0;
  /// Of the position, along east, north and up [m^2].
  Eigen::Matrix3d covariance_enu = Eigen::Matrix3d::Identity();
};

/// Why no place can be taken from it, naming field and value; empty where one can. Positions within
/// some 600 km of a pole are refused, as in datum_from_text(), and so is latitude and longitude 0,
/// which receivers send that know no place yet.
[[nodiscard]] std::string fault_of(const GnssFix& fix);

}  // namespace stillmap
