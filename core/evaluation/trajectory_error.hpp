#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/trajectory.hpp"

namespace stillmap::evaluation {

/// True and estimated poses at the same times, in time order: entry i of both belongs together.
/// Both map the same body frame (lidar or camera, the caller's choice) to a world frame of their
/// own; the two world frames may differ.
struct PosePairs {
  std::vector<Eigen::Isometry3d> truth;
  std::vector<Eigen::Isometry3d> estimate;

  [[nodiscard]] std::size_t size() const { return truth.size(); }
};

/// Pairs pose i with pose i. Throws std::invalid_argument when the lengths differ, when there is no
/// pose, or when a pose is not finite or not a rotation; the text names the pose.
[[nodiscard]] PosePairs pair_by_index(std::span<const Eigen::Isometry3d> truth,
                                      std::span<const Eigen::Isometry3d> estimate);

/// Pairs every pose of the series with the longer period with that of the other which is nearest in
/// time, if it is at most `max_difference_ns` away; each is used once. Throws std::invalid_argument
/// as pair_by_index does, and when stamps do not increase or no pair is found.
[[nodiscard]] PosePairs pair_by_stamp(const Trajectory& truth, const Trajectory& estimate,
                                      std::int64_t max_difference_ns);

/// Distance travelled up to each pose [m]; starts with 0, as long as `poses`.
[[nodiscard]] std::vector<double> distance_travelled(std::span<const Eigen::Isometry3d> poses);

/// Angle of the rotation, 0..pi [rad].
[[nodiscard]] double rotation_angle(const Eigen::Isometry3d& T);

/// How the estimate's world frame is aligned with the truth's before they are compared.
enum class Alignment {
  /// Not at all: both use the same world frame.
  none,
  /// The first poses coincide.
  first_pose,
  /// Least-squares rotation and translation (S. Umeyama, 1991, scale 1).
  rigid,
};

/// Absolute trajectory error (ATE) in translation, after alignment.
struct AbsoluteTrajectoryError {
  double rmse_m = 0.0;
  double mean_m = 0.0;
  double max_m = 0.0;
  /// Error of the last pose.
  double final_m = 0.0;
  std::vector<double> per_pose_m;
  /// The alignment: estimate's world to truth's world.
  Eigen::Isometry3d T_truth_estimate = Eigen::Isometry3d::Identity();
};

[[nodiscard]] AbsoluteTrajectoryError absolute_trajectory_error(const PosePairs& pairs,
                                                                Alignment alignment);

/// Error of the motion from one pose to the next; independent of any alignment.
struct RelativePoseError {
  double mean_translation_m = 0.0;
  double rmse_translation_m = 0.0;
  double max_translation_m = 0.0;
  double mean_rotation_rad = 0.0;
  double max_rotation_rad = 0.0;
};

/// Empty for fewer than two poses.
[[nodiscard]] std::optional<RelativePoseError> relative_pose_error(const PosePairs& pairs);

/// Mean errors of all segments of one length.
struct KittiLengthError {
  double length_m = 0.0;
  std::size_t segments = 0;
  double translation_percent = 0.0;
  double rotation_deg_per_100m = 0.0;
};

/// The figures of the KITTI odometry benchmark (A. Geiger et al., CVPR 2012, and its development
/// kit): segments of 100, 200 .. 800 m of the true path, one begun at every tenth pose, each
/// error divided by the segment's length, and the mean over all segments of all lengths.
struct KittiOdometryError {
  double translation_percent = 0.0;
  double rotation_deg_per_100m = 0.0;
  std::size_t segments = 0;
  /// Only lengths that occur.
  std::vector<KittiLengthError> by_length;
};

/// Empty when the true path is shorter than 100 m.
[[nodiscard]] std::optional<KittiOdometryError> kitti_odometry_error(const PosePairs& pairs);

}  // namespace stillmap::evaluation
