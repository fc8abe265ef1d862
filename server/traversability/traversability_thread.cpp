#include "server/traversability/traversability_thread.hpp"

#include <spdlog/spdlog.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

#include "core/map/tile_evidence.hpp"
#include "server/monitoring/idle_scheduling.hpp"

namespace stillmap::server {
namespace {

// How long a thread without work sleeps; a change or a stop wakes it.
constexpr std::chrono::seconds idle_period{1};

/// Areas take memory as the map does: where that is on disk, they are worked out when asked for.
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
                                           std::function<void()> updated, ThrottleCallback throttle)
    : period_(period),
      latest_map_(latest_map),
      snapshot_(snapshot),
      statistics_(statistics),
      updated_(std::move(updated)),
      throttle_(std::move(throttle)),
      traversability_(std::move(robots)) {
  publish();
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void TraversabilityThread::work(const std::stop_token& stop) {
  if (!use_idle_scheduling()) spdlog::warn("areas are computed at full priority");
  std::shared_ptr<const MapSnapshot> known;
  Clock::time_point next_update;
  while (!stop.stop_requested()) {
    const auto map_update = latest_map_.wait_for_update(known, stop, idle_period);
    if (!map_update) continue;
    wait_until(next_update, stop);
    if (stop.stop_requested()) return;
    next_update = Clock::now() + std::chrono::duration_cast<Clock::duration>(period_);
    known = latest_map_.view();
    update(in_memory(*known));
    const std::chrono::duration<double, std::milli> latency =
        Clock::now() - map_update->published_at;
    statistics_.add_latency("areas", latency.count());
  }
}

void TraversabilityThread::update(const MapSnapshot& map) {
  // One core only: its loops must not run on threads that keep their full priority, and only this
  // thread gives way.
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

void TraversabilityThread::wait_until(Clock::time_point time, const std::stop_token& stop) {
  std::unique_lock lock(pause_mutex_);
  pause_.wait_until(lock, stop, time, [] { return false; });
}

}  // namespace stillmap::server
