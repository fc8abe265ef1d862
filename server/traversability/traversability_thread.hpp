#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/traversability/traversability_map.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/periodic_worker.hpp"
#include "server/traversability/traversability_snapshot.hpp"

namespace stillmap::server {

/// The map that is followed.
struct FollowedMap {
  const LatestMap& latest;
  TileReader& tiles;
  /// Memory for the traversability of tiles on disk, nearest first; that of resident ones is kept.
  std::size_t bytes_on_disk = 0;
};

/// How it is followed, and who hears of that.
struct TraversabilityUpdates {
  /// The shortest time from update to update.
  std::chrono::duration<double> period{};
  /// Called after each update, and where the robot moved on without one, in the thread.
  std::function<void()> updated;
  /// Called between the portions of an update.
  ThrottleCallback throttle{};
  BackgroundScheduling scheduling = BackgroundScheduling::idle;
};

/// Keeps the traversability of all robots up to date with the map in a window round the robot, on a
/// thread of idle priority that uses one core.
class TraversabilityThread {
 public:
  /// The time from a change of the map until its update is the latency "traversability". Publishes
  /// empty views at once. Throws std::invalid_argument for a robot with faults, or two of one name.
  TraversabilityThread(std::vector<RobotProfile> robots, const FollowedMap& map,
                       TraversabilitySnapshot& snapshot, Statistics& statistics,
                       TraversabilityUpdates updates,
                       MonotonicClock& clock = MonotonicClock::steady());

 private:
  void follow_map(const std::stop_token& stop);
  /// While the map does not change: scans that tell no place drive through it, too.
  void follow_robot();
  void update_window();
  /// The tiles in the window whose traversability is kept, and some more of those on disk.
  [[nodiscard]] MapSnapshot kept_part(const MapSnapshot& map);
  /// Of the tiles in the window; the others are appended to `resident`.
  [[nodiscard]] std::vector<std::shared_ptr<const Tile>> on_disk_nearest_first(
      const MapSnapshot& map, std::vector<std::shared_ptr<const Tile>>& resident) const;
  void publish();

  FollowedMap map_;
  TraversabilitySnapshot& snapshot_;
  Statistics& statistics_;
  TraversabilityUpdates updates_;
  MonotonicClock& clock_;
  TraversabilityMap traversability_;
  ThrottledLog throttled_log_;
  bool has_begun_ = false;
  MapInWindow known_;
  Eigen::Vector3d robot_map_ = Eigen::Vector3d::Zero();
  std::set<TileId> kept_;
  /// Those that are to be kept are not all read yet.
  bool has_more_on_disk_ = false;
  /// When tiles that could not be read are tried again.
  std::optional<MonotonicClock::TimePoint> retry_;
  MonotonicClock::TimePoint next_update_;
  // Last: stops before what it uses is gone.
  std::optional<PeriodicWorker> worker_;
};

}  // namespace stillmap::server
