#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "core/traversability/traversability_map.hpp"
#include "server/traversability/traversability_snapshot.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap {

/// Keeps the areas of all robots up to date with the map, in a thread of its own that gives way to
/// all others: it has a low priority and works on one core.
class AreaThread {
 public:
  /// `period` is the shortest time from update to update; `updated` is called after each, in this
  /// thread. The time from a change of the map until then is the latency "areas". Shows empty areas
  /// at once. Throws std::invalid_argument for a robot with faults, or two of one name.
  AreaThread(std::vector<RobotProfile> robots, std::chrono::duration<double> period,
             const MapBoard& maps, AreaBoard& areas, Statistics& statistics,
             std::function<void()> updated, Pause pause = {});

 private:
  using Clock = std::chrono::steady_clock;

  void work(const std::stop_token& stop);
  void update(const MapView& map);
  void show();
  void wait_until(Clock::time_point time, const std::stop_token& stop);

  std::chrono::duration<double> period_;
  const MapBoard& maps_;
  AreaBoard& areas_;
  Statistics& statistics_;
  std::function<void()> updated_;
  Pause give_way_;
  TraversabilityMap traversability_;
  std::mutex pause_mutex_;
  std::condition_variable_any pause_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap
