#pragma once

#include <Eigen/Geometry>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "clients/library/client.hpp"

namespace stillmap::cli {

/// The poses that come back from a server, by stamp. What the odometry topic lost under way comes
/// from the path. Callbacks may come from any thread.
class PoseLog {
 public:
  /// Starts listening. The client must outlive the log.
  explicit PoseLog(Client& client);

  /// Waits until every one of these scans has its pose, or `timeout` has passed.
  void wait_for(const std::vector<std::int64_t>& stamps_ns, std::chrono::milliseconds timeout);

  /// The poses of these scans, in their order; scans without a pose are left out.
  [[nodiscard]] Trajectory poses_of(const std::vector<std::int64_t>& stamps_ns) const;

 private:
  /// From the odometry topic: a scan that is sent again gets a new pose.
  void take(const StampedPose& pose);
  /// From the path, which may still be that of another time.
  void add(const StampedPose& pose);

  mutable std::mutex mutex_;
  std::condition_variable added_;
  std::map<std::int64_t, Eigen::Isometry3d> T_map_lidar_;
  // Last: they end before what they write to.
  Subscription odometry_;
  Subscription path_;
};

}  // namespace stillmap::cli
