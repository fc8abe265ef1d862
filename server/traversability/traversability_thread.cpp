#include "server/traversability/traversability_thread.hpp"

#include <spdlog/spdlog.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

#include "core/map/tile_evidence.hpp"

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;

// How long the thread waits for a change of the map; a change or a stop wakes it.
constexpr std::chrono::seconds idle_period{1};

/// Traversability takes memory as the map does: for evicted tiles it is computed when queried.
MapSnapshot in_memory(const MapSnapshot& map) {
  MapSnapshot resident = map;
  std::erase_if(resident.tiles, [](const auto& tile) { return is_non_resident(*tile); });
  return resident;
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
  worker_.emplace(std::chrono::seconds(0), [this](const std::stop_token& stop) {
    if (!std::exchange(has_begun_, true) && !use_scheduling(scheduling_)) {
      spdlog::warn("traversability is computed at full priority");
    }
    follow_map(stop);
  });
}

void TraversabilityThread::follow_map(const std::stop_token& stop) {
  const auto map_update = latest_map_.wait_for_update(known_, stop, idle_period);
  if (!map_update) return;
  clock_.sleep_until(next_update_, stop);
  if (stop.stop_requested()) return;
  next_update_ = clock_.now() + std::chrono::duration_cast<Clock::duration>(period_);
  known_ = latest_map_.view();
  update(in_memory(*known_));
  const std::chrono::duration<double, std::milli> latency = Clock::now() - map_update->published_at;
  statistics_.add_latency("traversability", latency.count());
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
  snapshot_.publish(std::move(views));
}

}  // namespace stillmap::server
