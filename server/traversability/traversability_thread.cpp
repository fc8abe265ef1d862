#include "server/traversability/traversability_thread.hpp"

#include <spdlog/spdlog.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"
#include "server/threads/background_throttle.hpp"

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;

// How long the thread waits for a change of the map; a change or a stop wakes it.
constexpr std::chrono::seconds idle_period{1};

/// Edge of the square round the robot that is kept up to date [m]: an update costs as much as it
/// has tiles, however large the map is.
constexpr double window_m = 1000.0;

/// A grid that shows a window round the robot follows it in such steps while the map stays [m].
constexpr double noticed_motion_m = 1.0;

TileRange window_round(const Eigen::Vector3d& robot_map, double tile_size_m) {
  if (!(tile_size_m > 0.0)) return {};
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(window_m / 2.0);
  return tile_range({robot_map - half, robot_map + half}, tile_size_m);
}

/// Memory of a cell with its columns and objects, and for each robot, about [B].
constexpr std::size_t bytes_per_cell = 77;
constexpr std::size_t bytes_per_robot = 8;

std::size_t tiles_for(std::size_t bytes, std::size_t robots, const MapSnapshot& map) {
  if (!(map.voxel_size_m > 0.0)) return 0;
  const double cells = std::pow(map.tile_size_m / map.voxel_size_m, 2);
  const auto bytes_per_tile =
      cells * static_cast<double>(bytes_per_cell + robots * bytes_per_robot);
  return static_cast<std::size_t>(static_cast<double>(bytes) / bytes_per_tile);
}

/// Tiles are read from disk so many at a time: what the robot sees meanwhile does not wait.
constexpr std::size_t tiles_at_a_time = 16;
/// A robot that drives on does not give up at once what it may come back to, of so many.
constexpr double share_taken = 7.0 / 8.0;
/// What cannot be read is tried again after so long.
constexpr std::chrono::seconds retry_period{5};

}  // namespace

TraversabilityThread::TraversabilityThread(std::vector<RobotProfile> robots, const FollowedMap& map,
                                           TraversabilitySnapshot& snapshot, Statistics& statistics,
                                           TraversabilityUpdates updates, MonotonicClock& clock)
    : map_(map),
      snapshot_(snapshot),
      statistics_(statistics),
      updates_(std::move(updates)),
      clock_(clock),
      traversability_(std::move(robots)) {
  publish();
  worker_.emplace("traversability", std::chrono::seconds(0), [this](const std::stop_token& stop) {
    if (!std::exchange(has_begun_, true) && !use_scheduling(updates_.scheduling)) {
      spdlog::warn("traversability is computed at full priority");
    }
    follow_map(stop);
  });
}

void TraversabilityThread::follow_map(const std::stop_token& stop) {
  const auto map_update = map_.latest.wait_for_update(
      known_.map, stop, has_more_on_disk_ ? std::chrono::milliseconds(0) : idle_period);
  if (!map_update) return has_more_on_disk_ ? update_window() : follow_robot();
  clock_.sleep_until(next_update_, stop);
  if (stop.stop_requested()) return;
  next_update_ = clock_.now() + std::chrono::duration_cast<Clock::duration>(updates_.period);
  MapInWindow next;
  next.corrections = map_.latest.corrections();
  next.stamp_ns = map_.latest.newest_pose().stamp_ns;
  const auto [view, published_at] = *map_.latest.wait_for_update(nullptr, {}, {});
  next.map = view;
  next.map_time = published_at;
  if (!known_.map || known_.map->map_id != next.map->map_id) kept_.clear();
  robot_map_ = map_.latest.newest_pose().T_map_lidar.translation();
  next.window = window_round(robot_map_, next.map->tile_size_m);
  known_ = std::move(next);
  update_window();
  const std::chrono::duration<double, std::milli> latency = Clock::now() - map_update->published_at;
  statistics_.add_latency("traversability", latency.count());
}

void TraversabilityThread::follow_robot() {
  if (!known_.map) return;
  if (retry_ && clock_.now() >= *retry_) return update_window();
  const Eigen::Vector3d robot_map = map_.latest.newest_pose().T_map_lidar.translation();
  if ((robot_map - robot_map_).norm() < noticed_motion_m) return;
  robot_map_ = robot_map;
  const TileRange window = window_round(robot_map_, known_.map->tile_size_m);
  if (window.first == known_.window.first && window.last == known_.window.last)
    return updates_.updated();
  known_.window = window;
  update_window();
}

std::vector<std::shared_ptr<const Tile>> TraversabilityThread::on_disk_nearest_first(
    const MapSnapshot& map, std::vector<std::shared_ptr<const Tile>>& resident) const {
  std::vector<std::pair<double, std::shared_ptr<const Tile>>> found;
  for (auto& tile : tiles_in_range(map.tiles, known_.window)) {
    if (!is_non_resident(*tile)) {
      resident.push_back(std::move(tile));
      continue;
    }
    const Eigen::Vector2d corner(tile->info.id.x, tile->info.id.y);
    const Eigen::Vector2d centre_map = map.tile_size_m * (corner.array() + 0.5).matrix();
    found.emplace_back((centre_map - robot_map_.head<2>()).norm(), std::move(tile));
  }
  std::ranges::stable_sort(found, {}, [](const auto& entry) { return entry.first; });
  std::vector<std::shared_ptr<const Tile>> tiles;
  tiles.reserve(found.size());
  for (auto& entry : found) tiles.push_back(std::move(entry.second));
  return tiles;
}

// Traversability takes memory as the map does: of what is on disk farther away, and beyond the
// window, it is computed when queried.
MapSnapshot TraversabilityThread::kept_part(const MapSnapshot& map) {
  MapSnapshot part = map;
  std::vector<std::shared_ptr<const Tile>> tiles;
  const auto on_disk = on_disk_nearest_first(map, tiles);
  const std::size_t room = tiles_for(map_.bytes_on_disk, traversability_.profiles().size(), map);
  const auto taken = static_cast<std::size_t>(share_taken * static_cast<double>(room));
  std::size_t added = 0;
  has_more_on_disk_ = false;
  for (std::size_t i = 0; i < std::min(room, on_disk.size()); ++i) {
    const TileId id = on_disk[i]->info.id;
    if (!kept_.contains(id)) {
      if (i >= taken) continue;
      if (added == tiles_at_a_time) {
        has_more_on_disk_ = true;
        continue;
      }
      ++added;
    }
    tiles.push_back(on_disk[i]);
  }
  kept_.clear();
  for (const auto& tile : tiles) kept_.insert(tile->info.id);
  if (on_disk.size() > room) {
    throttled_log_.warn("traversability",
                        "an eighth of map.memory_limit_mib has room for the traversability of " +
                            std::to_string(room) + " of the " + std::to_string(on_disk.size()) +
                            " tiles within 500 m that are on disk: the grid lacks the farthest");
  }
  part.tiles = TileTable(std::move(tiles));
  return part;
}

void TraversabilityThread::update_window() {
  const MapSnapshot part = kept_part(*known_.map);
  TraversabilityUpdate report;
  // On this thread only: the workers of TBB's other arenas run at full priority.
  tbb::task_arena this_thread(1);
  this_thread.execute(
      [&] { report = traversability_.update(part, updates_.throttle, &map_.tiles); });
  retry_.reset();
  if (report.unread_tiles > 0) {
    retry_ = clock_.now() + retry_period;
    throttled_log_.warn("traversability_unread",
                        std::to_string(report.unread_tiles) +
                            " tiles that are on disk could not be read for the grid; they are "
                            "tried again");
  }
  publish();
  updates_.updated();
}

void TraversabilityThread::publish() {
  TraversabilitySnapshot::Views views;
  for (const RobotProfile& robot : traversability_.profiles()) {
    views.push_back(traversability_.view(robot.name));
  }
  snapshot_.publish(std::move(views), known_);
}

}  // namespace stillmap::server
