#include "clients/commands/live/pose_log.hpp"

#include <algorithm>

namespace stillmap::cli {

PoseLog::PoseLog(Client& client)
    : odometry_(client.subscribe_odometry([this](const OdometryUpdate& update) {
        take(update.pose);
        added_.notify_one();
      })),
      path_(client.subscribe_path([this](const Trajectory& path) {
        for (const StampedPose& pose : path) add(pose);
        added_.notify_one();
      })) {}

void PoseLog::take(const StampedPose& pose) {
  const std::lock_guard lock(mutex_);
  T_map_lidar_.insert_or_assign(pose.stamp_ns, pose.T_map_lidar);
}

void PoseLog::add(const StampedPose& pose) {
  const std::lock_guard lock(mutex_);
  T_map_lidar_.try_emplace(pose.stamp_ns, pose.T_map_lidar);
}

void PoseLog::wait_for(const std::vector<std::int64_t>& stamps_ns,
                       std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  added_.wait_for(lock, timeout, [&] {
    return std::all_of(stamps_ns.begin(), stamps_ns.end(),
                       [&](std::int64_t stamp_ns) { return T_map_lidar_.contains(stamp_ns); });
  });
}

Trajectory PoseLog::poses_of(const std::vector<std::int64_t>& stamps_ns) const {
  const std::lock_guard lock(mutex_);
  Trajectory trajectory;
  for (const std::int64_t stamp_ns : stamps_ns) {
    const auto found = T_map_lidar_.find(stamp_ns);
    if (found != T_map_lidar_.end()) trajectory.push_back({stamp_ns, found->second});
  }
  return trajectory;
}

}  // namespace stillmap::cli
