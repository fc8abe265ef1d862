#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "core/traversability/traversability_map.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/traversability/traversability_snapshot.hpp"

namespace stillmap::server {

/// Keeps the areas of all robots up to date with the map, in a thread of its own that gives way to
/// all others: it has a low priority and works on one core.
class TraversabilityThread {
 public:
  /// `period` is the shortest time from update to update; `updated` is called after each, in this
  /// thread. The time from a change of the map until then is the latency "areas". Publishes empty
  /// areas at once. Throws std::invalid_argument for a robot with faults, or two of one name.
  TraversabilityThread(std::vector<RobotProfile> robots, std::chrono::duration<double> period,
                       const LatestMap& latest_map, TraversabilitySnapshot& snapshot,
                       Statistics& statistics, std::function<void()> updated,
                       ThrottleCallback throttle = {});

 private:
  using Clock = std::chrono::steady_clock;

  void work(const std::stop_token& stop);
  void update(const MapSnapshot& map);
  void publish();
  void wait_until(Clock::time_point time, const std::stop_token& stop);

  std::chrono::duration<double> period_;
  const LatestMap& latest_map_;
  TraversabilitySnapshot& snapshot_;
  Statistics& statistics_;
  std::function<void()> updated_;
  ThrottleCallback throttle_;
  TraversabilityMap traversability_;
  std::mutex pause_mutex_;
  std::condition_variable_any pause_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
