#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "core/lidar/trajectory.hpp"
#include "idl/dds/reader.hpp"
#include "nav_msgs.h"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/unreadable_samples.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Poses from another odometry (wheels, GNSS), by time. Only their motion is used, so their origin
/// does not matter. They are poses of a frame on the robot, whichever that is.
class PoseBuffer {
 public:
  /// A pose that is not later than the newest, or later by more than 5 s, is left out (false);
  /// after five of those in a row, each following the other, the clock is theirs, and they take the
  /// place of what was there.
  bool add(const StampedPose& pose);

  /// Motion of that frame from one time to another, by pose_at(); nothing when the poses do not
  /// reach that far.
  [[nodiscard]] std::optional<Eigen::Isometry3d> motion(std::int64_t from_ns,
                                                        std::int64_t to_ns) const;

  /// Interpolated, in the other odometry's own frame; up to 100 ms after the newest pose, which may
  /// be on its way still, as the frame moved until then. Nothing when the poses do not reach that
  /// far.
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose_at(std::int64_t stamp_ns) const;
  [[nodiscard]] std::optional<std::int64_t> newest_ns() const {
    return poses_.empty() ? std::nullopt : std::optional(poses_.back().stamp_ns);
  }

 private:
  std::deque<StampedPose> poses_;
  /// The newest that were left out, as far as they follow each other.
  std::deque<StampedPose> doubted_;
};

/// Motion of a frame on the robot.
struct PriorMotion {
  std::string frame;
  Eigen::Isometry3d T_before_after = Eigen::Isometry3d::Identity();
};

/// Pose of a frame on the robot.
struct PriorPose {
  /// header.frame_id and child_frame_id.
  std::string odom_frame;
  std::string frame;
  Eigen::Isometry3d T_odom_frame = Eigen::Isometry3d::Identity();
};

/// Receives the odometry prior; poses that are left out are counted
/// ("odometry_prior_out_of_order"), and messages that hold none ("odometry_prior_not_usable"),
/// which are also logged.
class OdometryPrior {
 public:
  OdometryPrior(dds::Participant& participant, const std::string& ros_topic,
                Statistics& statistics);

  /// Motion of the prior's child frame; nothing when the prior does not cover both times.
  [[nodiscard]] std::optional<PriorMotion> motion(std::int64_t from_ns, std::int64_t to_ns) const;

  /// Interpolated; nothing after the newest pose.
  [[nodiscard]] std::optional<PriorPose> pose_at(std::int64_t stamp_ns) const;

  /// Why it says nothing of this time; empty where no message has come yet, as there may be none to
  /// come.
  [[nodiscard]] std::string silence_at(std::int64_t stamp_ns) const;

 private:
  void add(const nav_msgs::msg::Odometry& message);

  Statistics& statistics_;
  mutable std::mutex mutex_;
  /// All between the same two frames.
  PoseBuffer poses_;
  std::string odom_frame_;
  std::string frame_;
  UnreadableSamples unreadable_;
  /// What the last message was of no use for; empty: it was.
  std::string fault_;
  ThrottledLog throttled_log_;
  dds::Reader<nav_msgs::msg::Odometry> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
