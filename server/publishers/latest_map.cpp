#include "server/publishers/latest_map.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <utility>

namespace stillmap::server {

std::optional<std::int64_t> seen_until_ns(const MapSnapshot& view, const SharedTrajectory& path) {
  if (path.empty()) return std::nullopt;
  std::int64_t newest_ns = path.back().stamp_ns;
  for (const StampedPose& pose : path) newest_ns = std::max(newest_ns, pose.stamp_ns);
  for (const auto& tile : view.tiles)
    if (!tile->voxels.empty()) newest_ns = std::max(newest_ns, tile->voxels.stamps_ns().back());
  return newest_ns;
}

void LatestMap::begin(std::shared_ptr<const MapSnapshot> view, SharedTrajectory trajectory) {
  auto history = std::make_shared<const TileHistory>(history_from(*view));
  const std::scoped_lock lock(mutex_);
  state_ = {std::move(view), std::move(history)};
  published_at_ = std::chrono::steady_clock::now();
  changed_.notify_all();
  trajectory_ = std::move(trajectory);
  stretch_begin_ = trajectory_.size();
  waiting_begin_.reset();
  newest_ = trajectory_.empty() ? StampedPose{} : trajectory_.back();
  health_ = OdometryHealth::initialised;
}

void LatestMap::correct(const MapCorrection& correction, std::shared_ptr<const MapSnapshot> view) {
  publish(std::move(view));
  SharedTrajectory corrected = trajectory();
  const SharedTrajectory before = corrected;
  const std::size_t begin = [this] {
    const std::scoped_lock lock(mutex_);
    return stretch_begin_;
  }();
  corrected.truncate(begin);
  for (std::size_t i = begin; i < before.size(); ++i) {
    StampedPose pose = before[i];
    if (const auto* const T_new_old = correction.at(pose.stamp_ns))
      pose.T_map_lidar = *T_new_old * pose.T_map_lidar;
    corrected.push_back(pose);
  }
  // Only the mapping thread adds poses: none came meanwhile.
  const std::scoped_lock lock(mutex_);
  trajectory_ = std::move(corrected);
  if (const auto* const T_new_old = correction.at(newest_.stamp_ns))
    newest_.T_map_lidar = *T_new_old * newest_.T_map_lidar;
  ++corrections_;
}

void LatestMap::publish(std::shared_ptr<const MapSnapshot> view) {
  // Only the mapping thread publishes views, so the state cannot change between the two locks.
  const MapState before = state();
  if (before.view == view) return;
  auto history = std::make_shared<const TileHistory>(before.history ? history_with(before, *view)
                                                                    : history_from(*view));
  const std::scoped_lock lock(mutex_);
  state_ = {std::move(view), std::move(history)};
  published_at_ = std::chrono::steady_clock::now();
  changed_.notify_all();
}

bool LatestMap::add_pose(const StampedPose& pose, OdometryHealth health,
                         const std::string& label_source, MapEntry entry) {
  const std::scoped_lock lock(mutex_);
  ++poses_added_;
  health_ = health;
  label_source_ = label_source;
  if (health != OdometryHealth::lost) newest_ = pose;
  const bool is_denied = entry == MapEntry::stays_out_with_waiting;
  if (is_denied || is_confirmed(entry)) {
    const auto waiting = std::exchange(waiting_begin_, std::nullopt);
    if (waiting && entry != MapEntry::enters_with_waiting) trajectory_.truncate(*waiting);
    stretch_begin_ = std::min(stretch_begin_, trajectory_.size());
  }
  // A pose that nothing confirmed is no part of the path, nor of its file.
  if (health == OdometryHealth::lost || is_denied) return false;
  const std::size_t end = trajectory_.size();
  const bool is_set_back = end > stretch_begin_ && trajectory_.back().stamp_ns >= pose.stamp_ns;
  if (is_set_back) stretch_begin_ = end;
  if (entry == MapEntry::waits && !waiting_begin_) waiting_begin_ = end;
  trajectory_.push_back(pose);
  return is_set_back;
}

std::shared_ptr<const MapSnapshot> LatestMap::view() const {
  const std::scoped_lock lock(mutex_);
  return state_.view;
}

std::optional<LatestMap::MapUpdate> LatestMap::wait_for_update(
    const std::shared_ptr<const MapSnapshot>& known, const std::stop_token& stop,
    std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  const bool is_new =
      changed_.wait_for(lock, stop, timeout, [&] { return state_.view && state_.view != known; });
  if (!is_new) return std::nullopt;
  return MapUpdate{state_.view, published_at_};
}

MapState LatestMap::state() const {
  const std::scoped_lock lock(mutex_);
  return state_;
}

SharedTrajectory LatestMap::trajectory() const {
  const std::scoped_lock lock(mutex_);
  return trajectory_;
}

std::optional<std::int64_t> LatestMap::seen_until_ns() const {
  return server::seen_until_ns(*view(), trajectory());
}

StampedPose LatestMap::newest_pose() const {
  const std::scoped_lock lock(mutex_);
  return newest_;
}

Trajectory LatestMap::trajectory(std::size_t max_poses) const {
  const SharedTrajectory whole = trajectory();
  if (whole.empty()) return {};
  const std::size_t last = whole.size() - 1;
  std::size_t stride = 1;
  while ((last + stride - 1) / stride + 1 > max_poses) stride *= 2;
  Trajectory chosen;
  for (std::size_t i = 0; i < last; i += stride) chosen.push_back(whole[i]);
  chosen.push_back(whole.back());
  return chosen;
}

std::optional<Eigen::Isometry3d> LatestMap::pose_in_loaded_path(std::int64_t stamp_ns) const {
  const SharedTrajectory path = trajectory();
  if (path.empty()) return std::nullopt;
  const auto then = std::ranges::find(path, stamp_ns, &StampedPose::stamp_ns);
  return then == path.end() ? path.back().T_map_lidar : then->T_map_lidar;
}

Trajectory LatestMap::way_in_loaded_path(std::int64_t stamp_ns) const {
  const SharedTrajectory path = trajectory();
  const auto then = std::ranges::find(path, stamp_ns, &StampedPose::stamp_ns);
  const auto before = static_cast<std::size_t>(std::distance(path.begin(), then));
  if (before < 2) return {};
  return {path[before - 2], path[before - 1]};
}

std::size_t LatestMap::poses_stored() const {
  const std::scoped_lock lock(mutex_);
  return trajectory_.size();
}

std::uint64_t LatestMap::poses_added() const {
  const std::scoped_lock lock(mutex_);
  return poses_added_;
}

std::uint64_t LatestMap::corrections() const {
  const std::scoped_lock lock(mutex_);
  return corrections_;
}

OdometryHealth LatestMap::health() const {
  const std::scoped_lock lock(mutex_);
  return health_;
}

std::string LatestMap::label_source() const {
  const std::scoped_lock lock(mutex_);
  return label_source_;
}

}  // namespace stillmap::server
