#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "core/lidar/trajectory.hpp"
#include "idl/dds/reader.hpp"
#include "nav_msgs.h"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Poses from another odometry (wheels, GNSS), by time. Only their motion is used, so their origin
/// does not matter; their child frame must be the lidar's.
class PoseBuffer {
 public:
  /// Out-of-order poses are left out.
  void add(const StampedPose& pose);

  /// Motion of the lidar from one time to another, interpolated; nothing when the poses do not
  /// reach that far.
  [[nodiscard]] std::optional<Eigen::Isometry3d> motion(std::int64_t from_ns,
                                                        std::int64_t to_ns) const;

 private:
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose_at(std::int64_t stamp_ns) const;

  std::deque<StampedPose> poses_;
};

/// Receives the odometry prior, and predicts the poses of scans from it.
class OdometryPrior {
 public:
  OdometryPrior(dds::Participant& participant, const std::string& ros_topic);

  /// Where a scan at `stamp_ns` should be, given where the last one was; nothing when the prior
  /// does not cover both times.
  [[nodiscard]] std::optional<Eigen::Isometry3d> predict(const StampedPose& last,
                                                         std::int64_t stamp_ns) const;

 private:
  mutable std::mutex mutex_;
  PoseBuffer poses_;
  dds::Reader<nav_msgs::msg::Odometry> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
