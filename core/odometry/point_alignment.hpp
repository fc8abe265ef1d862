#pragma once

#include <Eigen/Geometry>

#include "core/odometry/registration.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {

struct PointAlignmentConfig {
  /// A point's counterpart is the nearest one within this distance [m]; at most the map's voxel
  /// size.
  double max_distance_m = 1.5;
  /// Scale of the Geman-McClure kernel [m].
  double kernel_m = 0.5;
  int max_iterations = 50;
  /// Leave out what could move by its label.
  bool without_movable = false;
  /// Converged when a step is below both.
  double step_translation_m = 0.002;
  double step_rotation_rad = 0.0002;
};

struct PointAlignment {
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Points with a counterpart at the pose of the last iteration.
  int matched = 0;
  /// Mean of the kernel's weight over all points: 1 is a perfect fit.
  double fit = 0.0;
  bool converged = false;
};

/// Rigid alignment of a scan's points with earlier points: point-to-point ICP with a robust kernel
/// (KISS-ICP, RA-L 2023, eq. 5-8). No labels, rings or surfaces: an order coarser than the
/// registration of features, since no two scans hit the same places, but it fails where none of
/// what that assumes would show. Points on level ground count by their height alone: the rings of a
/// lidar on it go along with the lidar. The features' `points` and `level_points` are compensated
/// for the motion within the sweep by `sweep_correction` beyond what they were.
[[nodiscard]] PointAlignment align_points(const FeatureSets& features, const FeatureMap& points_map,
                                          const Eigen::Isometry3d& T_map_lidar_start,
                                          const SweepCorrection& sweep_correction = {},
                                          const PointAlignmentConfig& config = {});

}  // namespace stillmap
