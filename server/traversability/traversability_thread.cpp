#include "server/traversability/traversability_thread.hpp"

#include <spdlog/spdlog.h>
#include <tbb/task_arena.h>

#include <algorithm>
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

/// Traversability takes memory as the map does: for evicted tiles it is computed when queried, as
/// it is beyond the window.
MapSnapshot in_memory(const MapSnapshot& map, const TileRange& window) {
  MapSnapshot part = map;
  std::vector<std::shared_ptr<const Tile>> resident = tiles_in_range(map.tiles, window);
  std::erase_if(resident, [](const auto& tile) { return is_non_resident(*tile); });
  part.tiles = TileTable(std::move(resident));
  return part;
}

}  // namespace

TraversabilityThread::TraversabilityThread(std::vector<RobotProfile> robots,
                                           std::chrono::duration<double> period,
                                           const LatestMap& latest_map,
                                           TraversabilitySnapshot& snapshot, Statistics& statistics,
                                           std::function<void()> updated, ThrottleCallback throttle,
                                           MonotonicClock& clock, BackgroundScheduling scheduling)
    : period_(period),
      latest_map_(latest_map),
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
  const auto map_update = latest_map_.wait_for_update(known_, stop, idle_period);
  if (!map_update) return follow_robot();
  clock_.sleep_until(next_update_, stop);
  if (stop.stop_requested()) return;
  next_update_ = clock_.now() + std::chrono::duration_cast<Clock::duration>(period_);
  corrections_ = latest_map_.corrections();
  known_ = latest_map_.view();
  robot_map_ = latest_map_.newest_pose().T_map_lidar.translation();
  window_ = window_round(robot_map_, known_->tile_size_m);
  update(in_memory(*known_, window_));
  const std::chrono::duration<double, std::milli> latency = Clock::now() - map_update->published_at;
  statistics_.add_latency("traversability", latency.count());
}

void TraversabilityThread::follow_robot() {
  if (!known_) return;
  const Eigen::Vector3d robot_map = latest_map_.newest_pose().T_map_lidar.translation();
  if ((robot_map - robot_map_).norm() < noticed_motion_m) return;
  robot_map_ = robot_map;
  const TileRange window = window_round(robot_map_, known_->tile_size_m);
  if (window.first == window_.first && window.last == window_.last) return updated_();
  window_ = window;
  update(in_memory(*known_, window_));
}

void TraversabilityThread::update(const MapSnapshot& map) {
  // On this thread only: the workers of TBB's other arenas run at full priority.
  tbb::task_arena this_thread(1);
  this_thread.execute([&] { static_cast<void>(traversability_.update(map, throttle_)); });
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
