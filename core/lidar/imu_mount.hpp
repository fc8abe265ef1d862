#pragma once

#include <Eigen/Core>

namespace stillmap {

/// How an IMU is fixed to the lidar. Where it sits does not matter: rates of turn are the same all
/// over a rigid body, and gravity is read where the lidar moves steadily.
struct ImuMount {
  /// Takes directions along the IMU's axes to the lidar's.
  Eigen::Matrix3d R_lidar_imu = Eigen::Matrix3d::Identity();
  /// How late the IMU's stamps are against the lidar's clock [s]; what is left is estimated.
  double time_offset_s = 0.0;
};

}  // namespace stillmap
