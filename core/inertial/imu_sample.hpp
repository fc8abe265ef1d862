#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace stillmap {

/// One measurement of an IMU, along its own axes.
struct ImuSample {
  /// Nanoseconds since the Unix epoch (or since the start of the dataset), as scans have it.
  std::int64_t stamp_ns = 0;
  /// [rad/s]
  Eigen::Vector3d angular_velocity_imu = Eigen::Vector3d::Zero();
  /// Specific force: points up where the IMU rests [m/s^2].
  Eigen::Vector3d acceleration_imu = Eigen::Vector3d::Zero();
};

}  // namespace stillmap
