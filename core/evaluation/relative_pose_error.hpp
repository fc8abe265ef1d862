#pragma once

#include <optional>
#include <vector>

#include "core/evaluation/pose_pairs.hpp"

namespace stillmap::evaluation {

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
