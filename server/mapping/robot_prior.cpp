#include "server/mapping/robot_prior.hpp"

#include <utility>

#include "core/frames/rigid_motion.hpp"
#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {
namespace {

// No robot is faster; a prior that says so begins anew, or is broken.
constexpr double max_speed_m_s = 150.0;
constexpr double max_jump_m = 1.0;
// No odometry is later than this.
constexpr std::int64_t kept_ns = 2'000'000'000;
// At 100 Hz.
constexpr std::size_t max_kept = 200;
// So many scans in a row without it are no jitter.
constexpr int silent_scans = 5;
constexpr const char* input = "odometry prior";

}  // namespace

std::optional<Eigen::Isometry3d> RobotPrior::lidar_motion(std::int64_t from_ns,
                                                          std::int64_t to_ns) {
  trust_.forget_motion();
  if (prior_ == nullptr) return std::nullopt;
  const auto motion = prior_->motion(from_ns, to_ns);
  report(motion.has_value(), to_ns);
  if (!motion) return std::nullopt;
  const double distance_m = motion->T_before_after.translation().norm();
  const double interval_s = 1e-9 * static_cast<double>(to_ns - from_ns);
  if (!(distance_m <= max_jump_m + max_speed_m_s * interval_s)) {
    refuse("odometry_prior_jumps", "it jumps by " + std::to_string(distance_m) + " m in " +
                                       std::to_string(interval_s) + " s");
    return std::nullopt;
  }
  const auto T_lidar_frame = frames_.T_lidar_frame(motion->frame);
  if (T_lidar_frame) {
    const Eigen::Isometry3d foretold = motion_of_frame(*T_lidar_frame, motion->T_before_after);
    if (!trust_.is_possible(foretold, interval_s)) {
      refuse("odometry_prior_jumps", "it jumps by " + std::to_string(distance_m) +
                                         " m, or turns, as no robot does in " +
                                         std::to_string(interval_s) + " s");
      return std::nullopt;
    }
    tell_of_trust();
    if (!trust_.is_believed()) return std::nullopt;
    return foretold;
  }
  refuse("odometry_prior_unknown_frame",
         "it moves the frame '" + shown_name(motion->frame) +
             "' (child_frame_id), and where that is on the robot is not known; set frames.base "
             "and mount, or publish it on /tf_static beneath frames.base");
  return std::nullopt;
}

void RobotPrior::learn(const Trajectory& before, std::int64_t stamp_ns,
                       const OdometryResult& odometry) {
  if (odometry.health != OdometryHealth::good || before.empty()) return;
  trust_.learn(before.back().T_map_lidar.inverse() * odometry.T_map_lidar,
               1e-9 * static_cast<double>(stamp_ns - before.back().stamp_ns));
  tell_of_trust();
}

void RobotPrior::tell_of_trust() {
  if (std::exchange(was_believed_, trust_.is_believed()) == trust_.is_believed()) return;
  constexpr const char* kind = "odometry prior's motion";
  if (was_believed_) return statistics_.set_input_fault(kind, "");
  const std::string why =
      "it does not foretell how the lidar then moves: an encoder that fails, wheels that slip, or "
      "another robot's";
  refuse("odometry_prior_disbelieved", why);
  statistics_.set_input_fault(kind, "the odometry prior is not used: " + why);
}

std::optional<OdomPose> RobotPrior::pose_in_odom(std::int64_t stamp_ns,
                                                 const Eigen::Isometry3d& T_map_base) {
  // A clock that was set back.
  if (!poses_.empty() && stamp_ns <= poses_.back().stamp_ns) poses_.clear();
  poses_.push_back({stamp_ns, T_map_base});
  while (poses_.size() > max_kept || stamp_ns - poses_.front().stamp_ns > kept_ns)
    poses_.pop_front();
  std::optional<PriorPose> prior;
  auto pose = poses_.rbegin();
  for (; prior_ != nullptr && pose != poses_.rend(); ++pose) {
    prior = prior_->pose_at(pose->stamp_ns);
    if (prior) break;
  }
  const auto T_lidar_frame = prior ? frames_.T_lidar_frame(prior->frame) : std::nullopt;
  std::string why_not = "no pose of the odometry prior is of the time of a scan";
  if (prior && prior->odom_frame != odom_frame_) {
    const std::string unfit = "its poses are in the frame '" + shown_name(prior->odom_frame) +
                              "' (header.frame_id), and frames.odom is '" + odom_frame_ + "'";
    refuse("odometry_prior_unknown_frame", unfit);
    why_not = "the odometry prior cannot be used: " + unfit;
  } else if (prior && !T_lidar_frame) {
    why_not = "where the odometry prior's frame '" + shown_name(prior->frame) +
              "' (child_frame_id) is on the robot is not known";
  } else if (T_lidar_frame) {
    const Eigen::Isometry3d T_base_frame = frames_.T_base_lidar() * *T_lidar_frame;
    T_map_odom_ = pose->T_map_base * T_base_frame * prior->T_odom_frame.inverse();
    // What is older says less.
    poses_.erase(poses_.begin(), pose.base() - 1);
  }
  constexpr const char* kind = "odom";
  if (!T_map_odom_) {
    if (++unknown_scans_ == silent_scans) {
      statistics_.set_input_fault(kind, "map -> " + odom_frame_ + " is not published: " + why_not +
                                            " (frames.odom_source: prior)");
    }
    return std::nullopt;
  }
  if (std::exchange(unknown_scans_, 0) >= silent_scans) statistics_.set_input_fault(kind, "");
  return OdomPose{.T_map_odom = *T_map_odom_, .T_odom_base = T_map_odom_->inverse() * T_map_base};
}

void RobotPrior::correct_map(const Eigen::Isometry3d& T_corrected_map) {
  if (T_map_odom_) T_map_odom_ = T_corrected_map * *T_map_odom_;
  for (BasePose& pose : poses_) pose.T_map_base = T_corrected_map * pose.T_map_base;
}

void RobotPrior::report(bool has_said, std::int64_t stamp_ns) {
  if (has_said) {
    if (std::exchange(silent_scans_, 0) >= silent_scans) statistics_.set_input_fault(input, "");
    return;
  }
  const std::string why = prior_->silence_at(stamp_ns);
  if (why.empty()) return;
  statistics_.count("odometry_prior_missing");
  if (++silent_scans_ < silent_scans) return;
  const std::string text = "the odometry prior is not used: " + why;
  statistics_.set_input_fault(input, text);
  throttled_log_.warn("odometry_prior_missing", text);
}

void RobotPrior::refuse(const std::string& counter, const std::string& reason) {
  statistics_.count(counter);
  throttled_log_.warn(counter, "the odometry prior is not used: " + reason);
}

}  // namespace stillmap::server
