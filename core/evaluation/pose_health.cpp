#include "core/evaluation/pose_health.hpp"

#include <algorithm>

#include "core/evaluation/trajectory_error.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::evaluation {
namespace {

/// A right pose, and the true path up to it.
struct Anchor {
  Eigen::Isometry3d T_world_lidar_true;
  Eigen::Isometry3d T_map_lidar;
  double path_m = 0.0;
};

Eigen::Isometry3d motion_error(const Anchor& from, const Anchor& to) {
  const Eigen::Isometry3d true_motion = from.T_world_lidar_true.inverse() * to.T_world_lidar_true;
  return true_motion.inverse() * from.T_map_lidar.inverse() * to.T_map_lidar;
}

bool has_left(const Anchor& last_right, const Anchor& now, const WrongPoseLimits& limits) {
  const double path_m = now.path_m - last_right.path_m;
  const Eigen::Isometry3d error = motion_error(last_right, now);
  const double rotation_deg = rotation_angle(error) * deg_per_rad;
  return error.translation().norm() > limits.translation_m + limits.translation_share * path_m ||
         rotation_deg > limits.rotation_deg + limits.rotation_deg_per_m * path_m;
}

bool slides(const std::vector<Anchor>& right, const Anchor& now, const WrongPoseLimits& limits) {
  const auto after_window =
      std::upper_bound(right.begin(), right.end(), now.path_m - limits.drift_path_m,
                       [](double path_m, const Anchor& anchor) { return path_m < anchor.path_m; });
  const Anchor& base = after_window == right.begin() ? right.front() : *std::prev(after_window);
  return motion_error(base, now).translation().norm() >
         limits.drift_share * std::max(limits.drift_path_m, now.path_m - base.path_m);
}

bool is_called_good(const EvaluatedPose& pose) {
  return pose.health == OdometryHealth::good || pose.health == OdometryHealth::initialised;
}

}  // namespace

std::vector<bool> wrong_poses(std::span<const EvaluatedPose> poses, const WrongPoseLimits& limits) {
  std::vector<bool> wrong;
  wrong.reserve(poses.size());
  std::vector<Anchor> right;
  std::optional<Anchor> last;
  for (const EvaluatedPose& pose : poses) {
    if (!pose.T_world_lidar_true || !pose.T_map_lidar.matrix().allFinite()) {
      wrong.push_back(true);
      continue;
    }
    Anchor now{*pose.T_world_lidar_true, pose.T_map_lidar};
    if (last) {
      const double step_m =
          (now.T_world_lidar_true.translation() - last->T_world_lidar_true.translation()).norm();
      now.path_m = last->path_m + std::min(step_m, limits.max_step_m);
    }
    last = now;
    const bool is_wrong =
        !right.empty() && (has_left(right.back(), now, limits) || slides(right, now, limits));
    wrong.push_back(is_wrong);
    if (right.empty() || (!is_wrong && is_called_good(pose))) right.push_back(now);
  }
  return wrong;
}

HealthScore health_score(std::span<const EvaluatedPose> poses, const WrongPoseLimits& limits) {
  const std::vector<bool> wrong = wrong_poses(poses, limits);
  HealthScore score;
  score.poses = poses.size();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    score.wrong += wrong[i] ? 1 : 0;
    if (wrong[i] && is_called_good(poses[i])) score.wrong_called_good.push_back(i);
    if (!wrong[i] && poses[i].health == OdometryHealth::lost) score.right_called_bad.push_back(i);
  }
  return score;
}

}  // namespace stillmap::evaluation
