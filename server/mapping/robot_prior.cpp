#include "server/mapping/robot_prior.hpp"

#include "core/frames/rigid_motion.hpp"
#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {
namespace {

// No robot is faster; a prior that says so begins anew, or is broken.
constexpr double max_speed_m_s = 150.0;
constexpr double max_jump_m = 1.0;

}  // namespace

std::optional<Eigen::Isometry3d> RobotPrior::lidar_motion(std::int64_t from_ns,
                                                          std::int64_t to_ns) {
  const auto motion = prior_ != nullptr ? prior_->motion(from_ns, to_ns) : std::nullopt;
  if (!motion) return std::nullopt;
  const double distance_m = motion->T_before_after.translation().norm();
  const double interval_s = 1e-9 * static_cast<double>(to_ns - from_ns);
  if (!(distance_m <= max_jump_m + max_speed_m_s * interval_s)) {
    refuse("odometry_prior_jumps", "it jumps by " + std::to_string(distance_m) + " m in " +
                                       std::to_string(interval_s) + " s");
    return std::nullopt;
  }
  const auto T_lidar_frame = frames_.T_lidar_frame(motion->frame);
  if (T_lidar_frame) return motion_of_frame(*T_lidar_frame, motion->T_before_after);
  refuse("odometry_prior_unknown_frame",
         "it moves the frame '" + shown_name(motion->frame) +
             "' (child_frame_id), and where that is on the robot is not known; set frames.base "
             "and mount, or publish it on /tf_static beneath frames.base");
  return std::nullopt;
}

OdomPose RobotPrior::pose_in_odom(std::int64_t stamp_ns, const Eigen::Isometry3d& T_map_base) {
  const auto prior = prior_ != nullptr ? prior_->pose_at(stamp_ns) : std::nullopt;
  const auto T_lidar_frame = prior ? frames_.T_lidar_frame(prior->frame) : std::nullopt;
  if (prior && prior->odom_frame != odom_frame_) {
    refuse("odometry_prior_unknown_frame",
           "its poses are in the frame '" + shown_name(prior->odom_frame) +
               "' (header.frame_id), and frames.odom is '" + odom_frame_ + "'");
  } else if (T_lidar_frame) {
    const Eigen::Isometry3d T_base_frame = frames_.T_base_lidar() * *T_lidar_frame;
    T_map_odom_ = T_map_base * T_base_frame * prior->T_odom_frame.inverse();
  }
  return {.T_map_odom = T_map_odom_, .T_odom_base = T_map_odom_.inverse() * T_map_base};
}

void RobotPrior::refuse(const std::string& counter, const std::string& reason) {
  statistics_.count(counter);
  throttled_log_.warn(counter, "the odometry prior is not used: " + reason);
}

}  // namespace stillmap::server
