#include "core/frames/odom_frame.hpp"

#include <algorithm>
#include <utility>

#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// Without a measurement the robot is taken to go on for so long, and then to stand.
constexpr double max_extrapolation_s = 1.0;
/// What a motion may differ from the one before: what registration may be wrong by, and what
/// robots, cars and hands accelerate by at most.
constexpr double translation_margin_m = 0.5;
constexpr double rotation_margin_rad = 0.3;
constexpr double max_acceleration_m_s2 = 20.0;
constexpr double max_angular_acceleration_rad_s2 = 30.0;

Eigen::Isometry3d orthonormal(const Eigen::Isometry3d& T) {
  return Eigen::Translation3d(T.translation()) * Eigen::Quaterniond(T.linear()).normalized();
}

bool is_reachable(const Eigen::Isometry3d& motion, const PoseTangent& velocity, double interval_s) {
  const PoseTangent off = twist_of(motion_of(velocity * interval_s).inverse() * motion);
  const double square_s2 = interval_s * interval_s;
  return off.head<3>().norm() <= translation_margin_m + max_acceleration_m_s2 * square_s2 &&
         off.tail<3>().norm() <= rotation_margin_rad + max_angular_acceleration_rad_s2 * square_s2;
}

}  // namespace

OdomPose OdomFrame::update(std::int64_t stamp_ns, const Eigen::Isometry3d& T_map_base,
                           OdometryHealth health,
                           const std::optional<Eigen::Isometry3d>& motion_prior) {
  if (!last_stamp_ns_) {
    T_odom_base_ = T_map_base;
  } else {
    // A clock that was set back, or a scan that comes again, tells nothing of the time between.
    const double interval_s = std::max(0.0, 1e-9 * static_cast<double>(stamp_ns - *last_stamp_ns_));
    const bool is_found = health == OdometryHealth::good || health == OdometryHealth::degenerate;
    const Eigen::Isometry3d motion = T_map_base_.inverse() * T_map_base;
    if (is_found && is_connected_ && is_believed(motion, interval_s)) {
      T_odom_base_ = orthonormal(T_odom_base_ * motion);
      if (interval_s > 0.0) velocity_ = twist_of(motion) / interval_s;
      extrapolated_s_ = 0.0;
    } else if (motion_prior && is_prior_believed(*motion_prior, interval_s)) {
      T_odom_base_ = orthonormal(T_odom_base_ * *motion_prior);
      if (interval_s > 0.0) velocity_ = twist_of(*motion_prior) / interval_s;
      extrapolated_s_ = 0.0;
    } else {
      T_odom_base_ = orthonormal(T_odom_base_ * extrapolate(interval_s));
    }
  }
  last_stamp_ns_ = stamp_ns;
  T_map_base_ = T_map_base;
  is_connected_ = health != OdometryHealth::lost;
  OdomPose pose{.T_map_odom = T_map_base * T_odom_base_.inverse(), .T_odom_base = T_odom_base_};
  if (velocity_) pose.velocity = *velocity_;
  return pose;
}

Eigen::Isometry3d OdomFrame::extrapolate(double interval_s) {
  if (!velocity_) return Eigen::Isometry3d::Identity();
  const double going_on_s = std::min(interval_s, max_extrapolation_s - extrapolated_s_);
  const Eigen::Isometry3d motion = motion_of(*velocity_ * going_on_s);
  extrapolated_s_ += going_on_s;
  if (extrapolated_s_ >= max_extrapolation_s) velocity_.reset();
  return motion;
}

bool OdomFrame::is_prior_believed(const Eigen::Isometry3d& motion_prior, double interval_s) {
  const auto doubtful = std::exchange(doubtful_prior_, std::nullopt);
  const PoseTangent last = velocity_.value_or(PoseTangent::Zero());
  if (is_reachable(motion_prior, last, interval_s)) return true;
  if (doubtful && is_reachable(motion_prior, *doubtful, interval_s)) return true;
  if (interval_s > 0.0) doubtful_prior_ = twist_of(motion_prior) / interval_s;
  return false;
}

// Once may be a pose that is wrong; twice the same is a robot that was pushed.
bool OdomFrame::is_believed(const Eigen::Isometry3d& motion, double interval_s) {
  const auto doubtful = std::exchange(doubtful_velocity_, std::nullopt);
  if (!velocity_ || is_reachable(motion, *velocity_, interval_s)) return true;
  if (doubtful && is_reachable(motion, *doubtful, interval_s)) return true;
  if (interval_s > 0.0) doubtful_velocity_ = twist_of(motion) / interval_s;
  return false;
}

}  // namespace stillmap
