#pragma once

#include <Eigen/Core>
#include <vector>

namespace stillmap {

/// What an IMU says of the lidar's rotation up to a sweep and within it.
struct InertialMotion {
  /// Takes directions of the lidar in the middle of the sweep to those at the last pose.
  Eigen::Matrix3d R_last_middle = Eigen::Matrix3d::Identity();
  /// Takes directions of the lidar at evenly spaced times from the sweep's start to its end to
  /// those in its middle; empty for a sweep of one instant.
  std::vector<Eigen::Matrix3d> R_middle_at;
};

}  // namespace stillmap
