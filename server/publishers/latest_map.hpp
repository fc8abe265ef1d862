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

/// The newest stamp of a map's poses and of its voxels in memory: lost poses and those of earlier
/// versions, where a clock that was set back took poses away, left voxels. Nothing without poses.
/// Takes time in proportion to both.
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
  /// True where its stamp is not after the last one's of this run: the clock was set back. The
  /// poses until then stay, as their voxels do, and a new stretch of the path begins, as with a new
  /// run. A lost pose changes health and label source alone. Poses that `entry` shows to be wrong,
  /// and those that waited for it, are no part of the path.
  bool add_pose(const StampedPose& pose, OdometryHealth health, const std::string& label_source,
                MapEntry entry = MapEntry::enters);

  /// The poses of this stretch were wrong by that; published with the view that it led to.
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
  /// The two stored poses before that scan's, or the path's last two; nothing where there are
  /// fewer.
  [[nodiscard]] Trajectory way_in_loaded_path(std::int64_t stamp_ns) const;
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
  /// Where the poses of this run begin in it, or those since its clock was set back: their stamps
  /// rise.
  std::size_t stretch_begin_ = 0;
  /// Where those begin in it that wait until a later one shows whether they are right.
  std::optional<std::size_t> waiting_begin_;
  StampedPose newest_;
  std::uint64_t poses_added_ = 0;
  std::uint64_t corrections_ = 0;
  OdometryHealth health_ = OdometryHealth::initialised;
  std::string label_source_;
};

}  // namespace stillmap::server
