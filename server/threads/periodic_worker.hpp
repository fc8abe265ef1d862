#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>

#include "server/threads/monotonic_clock.hpp"

namespace stillmap::server {

/// Calls its work again and again on a thread of its own until destroyed.
class PeriodicWorker {
 public:
  using Work = std::function<void(const std::stop_token& stop)>;
  /// Returns when the next round is due.
  using Round = std::function<MonotonicClock::TimePoint(const std::stop_token& stop)>;

  /// Pauses for `period` between the end of one call and the next; 0 for work that waits itself,
  /// until something happens or a stop is requested. The thread has the name (name_this_thread).
  /// What it throws ends the worker and is reported (run_or_report).
  PeriodicWorker(std::string name, std::chrono::duration<double> period, Work work,
                 MonotonicClock& clock = MonotonicClock::steady());
  /// For rounds that say themselves when the next one is due.
  PeriodicWorker(std::string name, Round round, MonotonicClock& clock = MonotonicClock::steady());

  /// Ends soon; the destructor waits for that.
  void request_stop() { thread_.request_stop(); }

 private:
  std::jthread thread_;
};

}  // namespace stillmap::server
