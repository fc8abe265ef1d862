#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "core/lidar/shared_trajectory.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/query/tile_history.hpp"
#include "core/map/tile.hpp"
#include "core/odometry/odometry_state.hpp"

namespace stillmap::server {

/// The newest stamp of a map's poses and of its voxels in memory: a clock that was set back took
/// poses away, but no voxels. Nothing without poses. Takes time in proportion to both.
[[nodiscard]] std::optional<std::int64_t> seen_until_ns(const MapSnapshot& view,
                                                        const SharedTrajectory& path);

/// What the mapping thread publishes to all other threads: immutable views, so that readers and the
/// mapper do not wait for each other. Thread-safe.
class LatestMap {
 public:
  /// A new map begins: its first view, and the poses that led to it. Those stay: the poses of this
  /// run follow them as a session of their own, whatever their stamps.
  void begin(std::shared_ptr<const MapSnapshot> view, SharedTrajectory trajectory);
  void publish(std::shared_ptr<const MapSnapshot> view);
  /// Removes poses of this session with the same or later stamps first: a clock that was set back
  /// replaces what it said. A lost pose changes health and label source alone. Poses that `entry`
  /// shows to be wrong, and those that waited for it, are no part of the path.
  void add_pose(const StampedPose& pose, OdometryHealth health, const std::string& label_source,
                MapEntry entry = MapEntry::enters);

  /// The poses of this session were wrong by that; published with the view that it led to.
  void correct(const MapCorrection& correction, std::shared_ptr<const MapSnapshot> view);

  /// Never null once `begin` was called.
  [[nodiscard]] std::shared_ptr<const MapSnapshot> view() const;
  /// A view, and when it was published.
  struct MapUpdate {
    std::shared_ptr<const MapSnapshot> view;
    std::chrono::steady_clock::time_point published_at;
  };
  /// Waits for another view than `known`. Nothing after `timeout` or when a stop was requested.
  [[nodiscard]] std::optional<MapUpdate> wait_for_update(
      const std::shared_ptr<const MapSnapshot>& known, const std::stop_token& stop,
      std::chrono::milliseconds timeout) const;
  /// The view and the history that ends with it.
  [[nodiscard]] MapState state() const;
  /// Costs little: it shares its poses.
  [[nodiscard]] SharedTrajectory trajectory() const;
  /// At most `max_poses` (>= 2) of its poses, evenly spaced, the newest always among them. The
  /// selection stays the same until the path has twice as many poses.
  [[nodiscard]] Trajectory trajectory(std::size_t max_poses) const;
  /// `stillmap::server::seen_until_ns` of it.
  [[nodiscard]] std::optional<std::int64_t> seen_until_ns() const;
  /// The newest pose that was not lost, whether or not it is a part of the path; the origin before
  /// the first.
  [[nodiscard]] StampedPose newest_pose() const;
  /// Expected pose of the first scan in a map that was loaded: the stored pose of its very stamp,
  /// when a recording is played again, else the last one, where the robot was switched off: a stamp
  /// that merely lies within the stored path's times may be that of a clock not set yet. Nothing
  /// without a stored path.
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose_in_loaded_path(std::int64_t stamp_ns) const;
  /// Poses of the path.
  [[nodiscard]] std::size_t poses_stored() const;
  /// Poses added so far, over all maps: changes with every scan.
  [[nodiscard]] std::uint64_t poses_added() const;
  /// How often the path was corrected, over all maps.
  [[nodiscard]] std::uint64_t corrections() const;
  [[nodiscard]] OdometryHealth health() const;
  [[nodiscard]] std::string label_source() const;

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  MapState state_;
  std::chrono::steady_clock::time_point published_at_;
  SharedTrajectory trajectory_;
  /// Where the poses of this session begin in it.
  std::size_t session_begin_ = 0;
  /// Where those begin in it that wait until a later one shows whether they are right.
  std::optional<std::size_t> waiting_begin_;
  StampedPose newest_;
  std::uint64_t poses_added_ = 0;
  std::uint64_t corrections_ = 0;
  OdometryHealth health_ = OdometryHealth::initialised;
  std::string label_source_;
};

}  // namespace stillmap::server
