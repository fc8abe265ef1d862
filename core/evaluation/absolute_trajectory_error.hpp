#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string_view>
#include <vector>

#include "core/evaluation/pose_pairs.hpp"

namespace stillmap::evaluation {

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

}  // namespace stillmap::evaluation
