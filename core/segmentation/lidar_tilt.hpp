#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "core/lidar/range_image.hpp"

namespace stillmap {

/// How a lidar leans on its robot. Networks have seen upright lidars: of others they get the points
/// along the robot's axes.
class LidarTilt {
 public:
  /// Upright.
  LidarTilt() = default;
  explicit LidarTilt(const Eigen::Matrix3d& R_base_lidar);

  /// Less than a degree is none: points may stay as they are.
  [[nodiscard]] bool is_upright() const { return tilt_rad_ < 0.017; }

  /// Along the robot's axes.
  [[nodiscard]] std::vector<Eigen::Vector3f> turned(
      std::span<const Eigen::Vector3f> points_lidar) const;

  /// Whether images are those of the turned points. A lidar that leans a little keeps its own, in
  /// which each beam has a row; of one that leans more, upright things would lean there.
  [[nodiscard]] bool turns_image() const;

  /// The field of view that what the lidar sees takes up in such an image: `upright` where it does
  /// not turn.
  [[nodiscard]] ProjectionModel widened(ProjectionModel upright) const;

 private:
  Eigen::Matrix3d R_base_lidar_ = Eigen::Matrix3d::Identity();
  /// Between the lidar's z axis and the robot's.
  double tilt_rad_ = 0.0;
};

}  // namespace stillmap
