#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "clients/library/client.hpp"

namespace stillmap::cli {

/// The poses that a server gives the scans of a replay, by stamp: those of the odometry topic, and
/// from the path those that were lost there. Thread-safe.
class ReplayPoses {
 public:
  /// Of the odometry topic: replaces the pose of a scan that is sent again.
  void take(const OdometryUpdate& update);
  /// Of the path, which may be older: replaces no pose.
  void take(const Trajectory& path);

  /// Waits until a path is known, at most for `timeout`.
  void wait_for_path(std::chrono::milliseconds timeout);
  /// The replay begins. Poses of the path until now are of an earlier one, which may have had the
  /// same stamps: they are none of this replay's, nor are those that the path gives these stamps
  /// from now on.
  void begin();

  /// Waits until every one of these scans has its pose, at most for `timeout`.
  void wait_for(const std::vector<std::int64_t>& stamps_ns, std::chrono::milliseconds timeout);

  /// The poses of these scans, in their order, without those that have none.
  [[nodiscard]] Trajectory poses_of(const std::vector<std::int64_t>& stamps_ns) const;

  /// What they are poses of.
  [[nodiscard]] std::string frame() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::int64_t, Eigen::Isometry3d> T_map_lidar_;
  std::set<std::int64_t> earlier_stamps_ns_;
  bool has_path_ = false;
  std::string frame_ = "lidar";
};

}  // namespace stillmap::cli
