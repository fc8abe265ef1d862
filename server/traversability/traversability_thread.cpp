#include "server/traversability/traversability_thread.hpp"

#include <spdlog/spdlog.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

#include "core/map/tile_store.hpp"
#include "server/monitoring/idle_scheduling.hpp"

namespace stillmap {
namespace {

// How long a thread without work sleeps; a change or a stop wakes it.
constexpr std::chrono::seconds idle_period{1};

/// Areas take memory as the map does: where that is on disk, they are worked out when asked for.
MapView in_memory(const MapView& map) {
  MapView resident = map;
  std::erase_if(resident.tiles, [](const auto& tile) { return is_away(*tile); });
  return resident;
}

}  // namespace

AreaThread::AreaThread(std::vector<RobotProfile> robots, std::chrono::duration<double> period,
                       const MapBoard& maps, AreaBoard& areas, Statistics& statistics,
                       std::function<void()> updated, Pause pause)
    : period_(period),
      maps_(maps),
      areas_(areas),
      statistics_(statistics),
      updated_(std::move(updated)),
      give_way_(std::move(pause)),
      traversability_(std::move(robots)) {
  show();
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void AreaThread::work(const std::stop_token& stop) {
  if (!run_in_background()) spdlog::warn("areas are computed at full priority");
  std::shared_ptr<const MapView> known;
  Clock::time_point next_update;
  while (!stop.stop_requested()) {
    const auto news = maps_.wait_for_news(known, stop, idle_period);
    if (!news) continue;
    wait_until(next_update, stop);
    if (stop.stop_requested()) return;
    next_update = Clock::now() + std::chrono::duration_cast<Clock::duration>(period_);
    known = maps_.view();
    update(in_memory(*known));
    const std::chrono::duration<double, std::milli> latency = Clock::now() - news->shown;
    statistics_.add_latency("areas", latency.count());
  }
}

void AreaThread::update(const MapView& map) {
  // One core only: its loops must not run on threads that keep their full priority, and only this
  // thread gives way.
  tbb::task_arena this_thread(1);
  this_thread.execute([&] { static_cast<void>(traversability_.update(map, give_way_)); });
  show();
  updated_();
}

void AreaThread::show() {
  AreaBoard::Views views;
  for (const RobotProfile& robot : traversability_.profiles()) {
    views.push_back(traversability_.view(robot.name));
  }
  areas_.show(std::move(views));
}

void AreaThread::wait_until(Clock::time_point time, const std::stop_token& stop) {
  std::unique_lock lock(pause_mutex_);
  pause_.wait_until(lock, stop, time, [] { return false; });
}

}  // namespace stillmap
