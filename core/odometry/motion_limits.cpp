#include "core/odometry/motion_limits.hpp"

namespace stillmap {
namespace {

/// Errors of poses, and of the times between them, that are no motion [m, rad].
constexpr double position_noise_m = 0.1;
constexpr double angle_noise_rad = 0.02;

}  // namespace

bool is_reachable(const RegisteredScan& last, const Eigen::Isometry3d& T_map_lidar,
                  double interval_s, bool has_velocity, const MotionLimits& limits) {
  const Eigen::Isometry3d motion = last.T_map_lidar.inverse() * T_map_lidar;
  const double distance_m = motion.translation().norm();
  if (distance_m > limits.max_speed_m_s * interval_s + position_noise_m) return false;
  const double angle_rad = Eigen::AngleAxisd(motion.linear()).angle();
  if (angle_rad > limits.max_turn_rate_rad_s * interval_s + angle_noise_rad) return false;
  if (!has_velocity) return true;
  // Mean velocities of both intervals, in the last scan's frame: their middles lie half of both
  // intervals apart.
  const Eigen::Vector3d expected_m =
      last.motion.linear().transpose() * last.motion.translation() * (interval_s / last.interval_s);
  const double between_middles_s = 0.5 * (interval_s + last.interval_s);
  return (motion.translation() - expected_m).norm() <=
         limits.max_acceleration_m_s2 * between_middles_s * interval_s + position_noise_m;
}

void keep_to_limits(const RegisteredScan& last, const PosePrediction& prediction,
                    bool last_moved_within_limits, const MotionLimits& limits,
                    OdometryResult& result) {
  if (result.health == OdometryHealth::lost || prediction.is_prior || prediction.interval_s <= 0.0)
    return;
  if (is_reachable(last, result.T_map_lidar, prediction.interval_s,
                   prediction.is_known && last_moved_within_limits, limits))
    return;
  result = lost_at(prediction.T_map_lidar);
  result.is_beyond_limits = true;
}

}  // namespace stillmap
