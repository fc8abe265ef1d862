#pragma once

#include <Eigen/Geometry>
#include <string>

namespace stillmap::simulation {

/// How the lidar moves on top of the vehicle that carries it.
enum class LidarMotion {
  /// Fixed to the vehicle.
  vehicle,
  /// A robot that turns on the spot: quarter turns at 55 degrees a second, which begin and end
  /// within a tenth of a second.
  hard_turns,
  /// In a hand, or on a walking robot: steps, sway, and glances to the sides.
  handheld,
};

/// Motion of that name ("vehicle", "hard_turns", "handheld").
/// @throws std::invalid_argument with the names that exist.
[[nodiscard]] LidarMotion lidar_motion(const std::string& name);

/// Pose of the moving lidar in the frame of the one that is fixed to the vehicle, `time_s` after
/// the first scan. The same for every seed.
[[nodiscard]] Eigen::Isometry3d T_vehicle_lidar_at(LidarMotion motion, double time_s);

}  // namespace stillmap::simulation
