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

/// Memory of a cell for two robots with its columns and objects, about [B].
constexpr std::size_t bytes_per_cell = 56;

std::size_t tiles_for(std::size_t bytes, const MapSnapshot& map) {
  if (!(map.voxel_size_m > 0.0)) return 0;
  const double cells = std::pow(map.tile_size_m / map.voxel_size_m, 2);
  return static_cast<std::size_t>(static_cast<double>(bytes) / (cells * bytes_per_cell));
}

}  // namespace

TraversabilityThread::TraversabilityThread(std::vector<RobotProfile> robots,
                                           std::chrono::duration<double> period,
                                           const FollowedMap& map, TraversabilitySnapshot& snapshot,
                                           Statistics& statistics, std::function<void()> updated,
                                           ThrottleCallback throttle, MonotonicClock& clock,
                                           BackgroundScheduling scheduling)
    : period_(period),
      map_(map),
      snapshot_(snapshot),
      statistics_(statistics),
      updated_(std::move(updated)),
      throttle_(std::move(throttle)),
      clock_(clock),
      traversability_(std::move(robots)),
      scheduling_(scheduling) {
  publish();
  worker_.emplace("traversability", std::chrono::seconds(0), [this](const std::stop_token& stop) {
    if (!std::exchange(has_begun_, true) && !use_scheduling(scheduling_)) {
      spdlog::warn("traversability is computed at full priority");
    }
    follow_map(stop);
  });
}

void TraversabilityThread::follow_map(const std::stop_token& stop) {
  const auto map_update = map_.latest.wait_for_update(known_, stop, idle_period);
  if (!map_update) return follow_robot();
  clock_.sleep_until(next_update_, stop);
  if (stop.stop_requested()) return;
  next_update_ = clock_.now() + std::chrono::duration_cast<Clock::duration>(period_);
  corrections_ = map_.latest.corrections();
  known_ = map_.latest.view();
  robot_map_ = map_.latest.newest_pose().T_map_lidar.translation();
  window_ = window_round(robot_map_, known_->tile_size_m);
  update_window();
  const std::chrono::duration<double, std::milli> latency = Clock::now() - map_update->published_at;
  statistics_.add_latency("traversability", latency.count());
}

void TraversabilityThread::follow_robot() {
  if (!known_) return;
  const Eigen::Vector3d robot_map = map_.latest.newest_pose().T_map_lidar.translation();
  if ((robot_map - robot_map_).norm() < noticed_motion_m) return;
  robot_map_ = robot_map;
  const TileRange window = window_round(robot_map_, known_->tile_size_m);
  if (window.first == window_.first && window.last == window_.last) return updated_();
  window_ = window;
  update_window();
}

// Traversability takes memory as the map does: of what is on disk farther away, and beyond the
// window, it is computed when queried.
MapSnapshot TraversabilityThread::kept_part(const MapSnapshot& map) {
  MapSnapshot part = map;
  std::vector<std::shared_ptr<const Tile>> tiles = tiles_in_range(map.tiles, window_);
  const auto distance_m = [&](const Tile& tile) {
    const Eigen::Vector2d corner(tile.info.id.x, tile.info.id.y);
    return (map.tile_size_m * (corner.array() + 0.5).matrix() - robot_map_.head<2>()).norm();
  };
  std::vector<double> on_disk_m;
  for (const auto& tile : tiles) {
    if (is_non_resident(*tile)) on_disk_m.push_back(distance_m(*tile));
  }
  const std::size_t kept = tiles_for(map_.bytes_on_disk, map);
  if (on_disk_m.size() > kept) {
    std::ranges::nth_element(on_disk_m, on_disk_m.begin() + static_cast<std::ptrdiff_t>(kept));
    const double reach_m = on_disk_m[kept];
    std::erase_if(tiles, [&](const auto& tile) {
      return is_non_resident(*tile) && distance_m(*tile) >= reach_m;
    });
    throttled_log_.warn("traversability",
                        "the grid lacks tiles that are on disk, " +
                            std::to_string(std::lround(reach_m)) +
                            " m and more from the robot: an eighth of map.memory_limit_mib has "
                            "room for the traversability of " +
                            std::to_string(kept) + " of " + std::to_string(on_disk_m.size()));
  }
  part.tiles = TileTable(std::move(tiles));
  return part;
}

void TraversabilityThread::update_window() {
  const MapSnapshot part = kept_part(*known_);
  // On this thread only: the workers of TBB's other arenas run at full priority.
  tbb::task_arena this_thread(1);
  this_thread.execute(
      [&] { static_cast<void>(traversability_.update(part, throttle_, &map_.tiles)); });
  publish();
  updated_();
}

void TraversabilityThread::publish() {
  TraversabilitySnapshot::Views views;
  for (const RobotProfile& robot : traversability_.profiles()) {
    views.push_back(traversability_.view(robot.name));
  }
  snapshot_.publish(std::move(views), known_, window_, corrections_);
}

}  // namespace stillmap::server
