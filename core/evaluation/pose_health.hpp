#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/odometry/odometry_state.hpp"

namespace stillmap::evaluation {

/// What odometry said of one scan, beside the truth.
struct EvaluatedPose {
  /// Pose of the lidar in any fixed frame; nothing where every pose is wrong, as for scans of a
  /// place that has nothing to do with the map.
  std::optional<Eigen::Isometry3d> T_world_lidar_true;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  OdometryHealth health = OdometryHealth::lost;
};

/// When a pose is wrong. Errors are those of the motion since an earlier right pose that was called
/// good, so that drift within the usual does not count, however long the drive, and what odometry
/// itself doubts is no measure of others.
struct WrongPoseLimits {
  /// Since the last right pose: this much [m, deg], and shares of the true path between the two.
  double translation_m = 0.2;
  double translation_share = 0.02;
  double rotation_deg = 1.0;
  double rotation_deg_per_m = 0.02;
  /// Since the newest right pose that lies at least `drift_path_m` of true path back, or the first
  /// one: share of the true path between the two, but of so long a one at least. Finds drives that
  /// slide away in small steps, and slow ones that do not move at all.
  double drift_path_m = 20.0;
  double drift_share = 0.05;
  /// The true path from one pose to the next counts as this much at most [m]: a recording that
  /// jumps allows no larger errors.
  double max_step_m = 5.0;
};

/// For every pose, in time order, whether it is wrong. The first one that has a truth is right by
/// definition: it is where the map begins. A pose that is not finite is wrong.
[[nodiscard]] std::vector<bool> wrong_poses(std::span<const EvaluatedPose> poses,
                                            const WrongPoseLimits& limits = {});

/// How far the health of poses can be believed. `degenerate` counts as neither good nor bad.
struct HealthScore {
  std::size_t poses = 0;
  std::size_t wrong = 0;
  /// Places in the list of wrong poses called `good` (or `initialised`).
  std::vector<std::size_t> wrong_called_good;
  /// Places of right ones called `lost`.
  std::vector<std::size_t> right_called_bad;
};

[[nodiscard]] HealthScore health_score(std::span<const EvaluatedPose> poses,
                                       const WrongPoseLimits& limits = {});

}  // namespace stillmap::evaluation
