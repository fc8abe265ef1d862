#include "clients/commands/live/replay_poses.hpp"

#include <algorithm>

namespace stillmap::cli {

void ReplayPoses::take(const OdometryUpdate& update) {
  const std::scoped_lock lock(mutex_);
  T_map_lidar_.insert_or_assign(update.pose.stamp_ns, update.pose.T_map_lidar);
  frame_ = update.child_frame;
  changed_.notify_all();
}

void ReplayPoses::take(const Trajectory& path) {
  const std::scoped_lock lock(mutex_);
  for (const StampedPose& pose : path) {
    if (earlier_stamps_ns_.contains(pose.stamp_ns)) continue;
    T_map_lidar_.try_emplace(pose.stamp_ns, pose.T_map_lidar);
  }
  has_path_ = true;
  changed_.notify_all();
}

void ReplayPoses::wait_for_path(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [this] { return has_path_; });
}

void ReplayPoses::begin() {
  const std::scoped_lock lock(mutex_);
  for (const auto& [stamp_ns, pose] : T_map_lidar_) earlier_stamps_ns_.insert(stamp_ns);
  T_map_lidar_.clear();
}

void ReplayPoses::wait_for(const std::vector<std::int64_t>& stamps_ns,
                           std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] {
    return std::ranges::all_of(
        stamps_ns, [&](std::int64_t stamp_ns) { return T_map_lidar_.contains(stamp_ns); });
  });
}

Trajectory ReplayPoses::poses_of(const std::vector<std::int64_t>& stamps_ns) const {
  const std::scoped_lock lock(mutex_);
  Trajectory trajectory;
  for (const std::int64_t stamp_ns : stamps_ns) {
    const auto found = T_map_lidar_.find(stamp_ns);
    if (found != T_map_lidar_.end()) trajectory.push_back({stamp_ns, found->second});
  }
  return trajectory;
}

std::string ReplayPoses::frame() const {
  const std::scoped_lock lock(mutex_);
  return frame_;
}

}  // namespace stillmap::cli
