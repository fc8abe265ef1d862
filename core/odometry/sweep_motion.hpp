#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/lidar/prepare.hpp"
#include "core/odometry/odometry_state.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {

/// Motion of the lidar within a sweep.
class SweepMotion {
 public:
  /// Steady along a screw; `T_start_end` is the motion during the whole sweep.
  explicit SweepMotion(const Eigen::Isometry3d& T_start_end = Eigen::Isometry3d::Identity());
  /// With a rotation that was measured, at evenly spaced times from start to end, relative to the
  /// middle (see InertialMotion); the translation, along the lidar's axes in the middle, is steady.
  SweepMotion(const Eigen::Vector3d& translation, std::vector<Eigen::Matrix3d> R_middle_at);

  /// Pose of the lidar at a part of the sweep (-0.5 start, 0.5 end) in its frame at the middle.
  [[nodiscard]] Eigen::Isometry3d T_middle_at(double part) const;

  /// Translation and rotation of the whole sweep.
  [[nodiscard]] const PoseTangent& twist() const { return twist_; }
  [[nodiscard]] bool rotation_is_measured() const { return !R_middle_at_.empty(); }

  /// Moves every point to the middle of the sweep. Keeps the points' times.
  void move_to_middle(Scan& scan, const SweepTimes& sweep) const;

 private:
  PoseTangent twist_;
  std::vector<Eigen::Matrix3f> R_middle_at_;
};

/// Pose of the lidar at a part of the sweep in its frame at the middle.
[[nodiscard]] Eigen::Isometry3d T_middle_at(const SweepCorrection& motion, double part);
/// Moves every point to the middle of the sweep. Keeps the points' times.
void move_to_middle(Scan& scan, const SweepTimes& sweep, const SweepCorrection& motion);

}  // namespace stillmap
