#include "server/mapping/odometry_prior.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "idl/conversions/pose.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::server {
namespace {

// At 100 Hz, 10 s: more than any scan waits in the queue.
constexpr std::size_t max_poses = 1000;
// So long past its newest pose an odometry is taken to go on as it went,
constexpr std::int64_t max_ahead_ns = 100'000'000;
// where its poses came no farther apart than this.
constexpr std::int64_t max_gap_ns = 250'000'000;
// No robot goes so far meanwhile.
constexpr double max_carried_m = 0.2;
constexpr double max_carried_m_s = 40.0;
// No odometry is so late.
constexpr double other_clock_s = 2.0;
// The next pose of an odometry comes sooner.
constexpr std::int64_t max_step_ns = 5'000'000'000;
// So many poses in a row, each after the other, are of the odometry's clock, whatever the poses
// before them said.
constexpr std::size_t proof_of_clock = 5;

bool follows(const StampedPose& before, const StampedPose& after) {
  return after.stamp_ns > before.stamp_ns && after.stamp_ns - before.stamp_ns <= max_step_ns;
}

Eigen::Isometry3d between(const StampedPose& before, const StampedPose& after,
                          std::int64_t stamp_ns) {
  const double share = static_cast<double>(stamp_ns - before.stamp_ns) /
                       static_cast<double>(after.stamp_ns - before.stamp_ns);
  const Eigen::Quaterniond q_before(before.T_map_lidar.rotation());
  const Eigen::Quaterniond q_after(after.T_map_lidar.rotation());
  const Eigen::Vector3d t_before = before.T_map_lidar.translation();
  const Eigen::Vector3d t_after = after.T_map_lidar.translation();
  return Eigen::Isometry3d(Eigen::Translation3d(t_before + share * (t_after - t_before)) *
                           q_before.slerp(share, q_after));
}

// This long after the newest pose: the motion of as long a time before it is made once more, so
// that stamps which jitter are not made speeds of. The newest pose where that motion is not known.
Eigen::Isometry3d carried_on(const std::deque<StampedPose>& poses, std::int64_t ahead_ns) {
  const StampedPose& newest = poses.back();
  const std::int64_t earlier_ns = newest.stamp_ns - ahead_ns;
  const auto after = std::ranges::upper_bound(poses, earlier_ns, {}, &StampedPose::stamp_ns);
  if (after == poses.begin()) return newest.T_map_lidar;
  const StampedPose& before = *std::prev(after);
  if (after->stamp_ns - before.stamp_ns > max_gap_ns) return newest.T_map_lidar;
  const Eigen::Isometry3d T_odom_earlier = between(before, *after, earlier_ns);
  const Eigen::Isometry3d T_earlier_newest = T_odom_earlier.inverse() * newest.T_map_lidar;
  // Where an odometry set itself elsewhere, that is no motion.
  const double way_m = T_earlier_newest.translation().norm();
  if (way_m > max_carried_m + 1e-9 * static_cast<double>(ahead_ns) * max_carried_m_s)
    return newest.T_map_lidar;
  const Eigen::Isometry3d carried = newest.T_map_lidar * T_earlier_newest;
  return carried.matrix().allFinite() ? carried : newest.T_map_lidar;
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
    const bool near = !poses_.empty() && stamp_ns - poses_.back().stamp_ns <= max_ahead_ns;
    if (!near) return std::nullopt;
    return carried_on(poses_, stamp_ns - poses_.back().stamp_ns);
  }
  if (after->stamp_ns == stamp_ns) return after->T_map_lidar;
  if (after == poses_.begin()) return std::nullopt;
  return between(*std::prev(after), *after, stamp_ns);
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
      unreadable_(ros_topic, "odometry_prior_unreadable", statistics),
      reader_(participant, dds::odometry_prior_topic(ros_topic).dds_name,
              dds::odometry_prior_topic(ros_topic).reader),
      worker_("odom_prior", std::chrono::seconds(0),
              [this, message = nav_msgs::msg::Odometry()](const std::stop_token& stop) mutable {
                const bool came = reader_.take(message, stop, std::chrono::seconds(1));
                unreadable_.report(reader_);
                if (came) add(message);
              }) {}

void OdometryPrior::add(const nav_msgs::msg::Odometry& message) {
  const auto odometry = wire::from_odometry(message);
  if (!odometry) {
    statistics_.count("odometry_prior_not_usable");
    const std::string fault =
        "a message has an orientation that is none (such as 0 0 0 0), a number that is not finite, "
        "or a stamp that is no time";
    throttled_log_.warn("odometry_prior", "the odometry prior is not used: " + fault);
    const std::scoped_lock lock(mutex_);
    fault_ = fault;
    return;
  }
  const std::scoped_lock lock(mutex_);
  fault_.clear();
  // tf2 knows none with a '/' at its front, which drivers of old send.
  const auto name = [](const std::string& frame) {
    return frame.substr(frame.starts_with('/') ? 1 : 0);
  };
  const std::string odom_frame = name(message.header().frame_id());
  const std::string frame = name(message.child_frame_id());
  // There is no motion from a pose of one frame to that of another.
  if (frame != frame_ || odom_frame != odom_frame_) poses_ = {};
  odom_frame_ = odom_frame;
  frame_ = frame;
  if (!poses_.add(odometry->pose)) statistics_.count("odometry_prior_out_of_order");
}

std::optional<PriorMotion> OdometryPrior::motion(std::int64_t from_ns, std::int64_t to_ns) const {
  const std::scoped_lock lock(mutex_);
  const auto T_before_after = poses_.motion(from_ns, to_ns);
  if (!T_before_after) return std::nullopt;
  return PriorMotion{frame_, *T_before_after};
}

std::string OdometryPrior::silence_at(std::int64_t stamp_ns) const {
  const std::scoped_lock lock(mutex_);
  if (!fault_.empty()) return fault_;
  const auto newest_ns = poses_.newest_ns();
  if (!newest_ns) return "";
  const double behind_s = 1e-9 * static_cast<double>(stamp_ns - *newest_ns);
  if (std::abs(behind_s) < other_clock_s) {
    return behind_s > 0.0 ? fmt::format(
                                "its poses come too late: the newest is {:.2f} s older than "
                                "the scan",
                                behind_s)
                          : "its poses begin after the last scan, or have a gap";
  }
  return fmt::format(
      "its newest pose is {:.1f} s {} than the scan: it fell silent, or has another "
      "clock",
      std::abs(behind_s), behind_s > 0.0 ? "older" : "newer");
}

std::optional<PriorPose> OdometryPrior::pose_at(std::int64_t stamp_ns) const {
  const std::scoped_lock lock(mutex_);
  // The next one is on its way, and an older one known.
  if (poses_.newest_ns().value_or(stamp_ns) < stamp_ns) return std::nullopt;
  const auto T_odom_frame = poses_.pose_at(stamp_ns);
  if (!T_odom_frame) return std::nullopt;
  return PriorPose{odom_frame_, frame_, *T_odom_frame};
}

}  // namespace stillmap::server
