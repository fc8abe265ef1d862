#include "server/mapping/odometry_prior.hpp"

#include <algorithm>
#include <utility>

#include "idl/conversions/pose.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::server {
namespace {

// At 100 Hz, 10 s: more than any scan waits in the queue.
constexpr std::size_t max_poses = 1000;
// A pose this much older than the scan still stands for it.
constexpr std::int64_t max_gap_ns = 100'000'000;
// The next pose of an odometry comes sooner.
constexpr std::int64_t max_step_ns = 5'000'000'000;
// So many poses in a row, each after the other, are of the odometry's clock, whatever the poses
// before them said.
constexpr std::size_t proof_of_clock = 5;

bool follows(const StampedPose& before, const StampedPose& after) {
  return after.stamp_ns > before.stamp_ns && after.stamp_ns - before.stamp_ns <= max_step_ns;
}

}  // namespace

bool PoseBuffer::add(const StampedPose& pose) {
  if (poses_.empty() || follows(poses_.back(), pose)) {
    doubted_.clear();
    poses_.push_back(pose);
    if (poses_.size() > max_poses) poses_.pop_front();
    return true;
  }
  if (!doubted_.empty() && !follows(doubted_.back(), pose)) doubted_.clear();
  doubted_.push_back(pose);
  if (doubted_.size() >= proof_of_clock) poses_ = std::exchange(doubted_, {});
  return false;
}

std::optional<Eigen::Isometry3d> PoseBuffer::pose_at(std::int64_t stamp_ns) const {
  const auto after = std::ranges::lower_bound(poses_, stamp_ns, {}, &StampedPose::stamp_ns);
  if (after == poses_.end()) {
    const bool near = !poses_.empty() && stamp_ns - poses_.back().stamp_ns <= max_gap_ns;
    return near ? std::optional(poses_.back().T_map_lidar) : std::nullopt;
  }
  if (after->stamp_ns == stamp_ns) return after->T_map_lidar;
  if (after == poses_.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double share = static_cast<double>(stamp_ns - before->stamp_ns) /
                       static_cast<double>(after->stamp_ns - before->stamp_ns);
  const Eigen::Quaterniond q_before(before->T_map_lidar.rotation());
  const Eigen::Quaterniond q_after(after->T_map_lidar.rotation());
  const Eigen::Vector3d t_before = before->T_map_lidar.translation();
  const Eigen::Vector3d t_after = after->T_map_lidar.translation();
  return Eigen::Isometry3d(Eigen::Translation3d(t_before + share * (t_after - t_before)) *
                           q_before.slerp(share, q_after));
}

std::optional<Eigen::Isometry3d> PoseBuffer::motion(std::int64_t from_ns,
                                                    std::int64_t to_ns) const {
  const auto T_odom_from = pose_at(from_ns);
  const auto T_odom_to = pose_at(to_ns);
  if (!T_odom_from || !T_odom_to) return std::nullopt;
  return T_odom_from->inverse() * *T_odom_to;
}

OdometryPrior::OdometryPrior(dds::Participant& participant, const std::string& ros_topic,
                             Statistics& statistics)
    : statistics_(statistics),
      reader_(participant, dds::odometry_prior_topic(ros_topic).dds_name,
              dds::odometry_prior_topic(ros_topic).reader),
      worker_("odom_prior", std::chrono::seconds(0),
              [this, message = nav_msgs::msg::Odometry()](const std::stop_token& stop) mutable {
                if (reader_.take(message, stop, std::chrono::seconds(1))) add(message);
              }) {}

void OdometryPrior::add(const nav_msgs::msg::Odometry& message) {
  const auto odometry = wire::from_odometry(message);
  if (!odometry) return;
  const std::scoped_lock lock(mutex_);
  // There is no motion from a pose of one frame to that of another.
  const bool is_same =
      message.child_frame_id() == frame_ && message.header().frame_id() == odom_frame_;
  if (!is_same) poses_ = {};
  odom_frame_ = message.header().frame_id();
  frame_ = message.child_frame_id();
  if (!poses_.add(odometry->pose)) statistics_.count("odometry_prior_out_of_order");
}

std::optional<PriorMotion> OdometryPrior::motion(std::int64_t from_ns, std::int64_t to_ns) const {
  const std::scoped_lock lock(mutex_);
  const auto T_before_after = poses_.motion(from_ns, to_ns);
  if (!T_before_after) return std::nullopt;
  return PriorMotion{frame_, *T_before_after};
}

std::optional<PriorPose> OdometryPrior::pose_at(std::int64_t stamp_ns) const {
  const std::scoped_lock lock(mutex_);
  const auto T_odom_frame = poses_.pose_at(stamp_ns);
  if (!T_odom_frame) return std::nullopt;
  return PriorPose{odom_frame_, frame_, *T_odom_frame};
}

}  // namespace stillmap::server
