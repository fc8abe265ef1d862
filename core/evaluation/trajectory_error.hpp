#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/lidar/trajectory.hpp"

namespace stillmap::evaluation {

/// True and estimated poses of the same moments, in step and in time order. Both take the same
/// body frame (lidar or camera: the caller sees to it) to their own world frame; the two world
/// frames may differ.
struct PosePairs {
  std::vector<Eigen::Isometry3d> truth;
  std::vector<Eigen::Isometry3d> estimate;

  [[nodiscard]] std::size_t size() const { return truth.size(); }
};

/// Pairs the poses one by one. Throws std::invalid_argument when the lengths differ, when there is
/// no pose, or when a pose is not finite or not a rotation; the text names which.
[[nodiscard]] PosePairs pair_by_index(std::span<const Eigen::Isometry3d> truth,
                                      std::span<const Eigen::Isometry3d> estimate);

/// Pairs every estimate with the true pose nearest in time, if it is at most `max_difference_ns`
/// away; a true pose is used once. Stamps of both must grow. Throws std::invalid_argument as
/// pair_by_index, when stamps do not grow, and when nothing pairs.
[[nodiscard]] PosePairs pair_by_stamp(const Trajectory& truth, const Trajectory& estimate,
                                      std::int64_t max_difference_ns);

/// Distance travelled up to each pose [m]; starts with 0, as long as `poses`.
[[nodiscard]] std::vector<double> distance_travelled(std::span<const Eigen::Isometry3d> poses);

/// Angle of the rotation, 0..pi [rad].
[[nodiscard]] double rotation_angle(const Eigen::Isometry3d& T);

/// How the estimate's world is laid over the truth's before they are compared.
enum class Alignment {
  /// They are the same world already.
  none,
  /// The first poses coincide; every later error counts in full.
  first_pose,
  /// The rotation and translation that fit best (S. Umeyama, 1991, without scale).
  rigid,
};

/// The alignment called "none", "first" or "rigid"; nothing for another word.
[[nodiscard]] std::optional<Alignment> alignment_from_name(std::string_view alignment_name);

/// Takes the estimate's world frame to the truth's.
[[nodiscard]] Eigen::Isometry3d find_alignment(const PosePairs& pairs, Alignment alignment);

/// Absolute trajectory error (ATE) in translation, after alignment.
struct AbsoluteTrajectoryError {
  double rmse_m = 0.0;
  double mean_m = 0.0;
  double max_m = 0.0;
  /// Error of the last pose.
  double final_m = 0.0;
  std::vector<double> per_pose_m;
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

/// Nothing when there is one pose only.
[[nodiscard]] std::optional<RelativePoseError> relative_pose_error(const PosePairs& pairs);

/// What is left of the true motion from pose `first` to pose `last` after the estimated one.
[[nodiscard]] Eigen::Isometry3d motion_error(const PosePairs& pairs, std::size_t first,
                                             std::size_t last);

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

/// Nothing when the true path is shorter than 100 m.
[[nodiscard]] std::optional<KittiOdometryError> kitti_odometry_error(const PosePairs& pairs);

}  // namespace stillmap::evaluation
