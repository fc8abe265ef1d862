#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <mutex>
#include <string>

#include "server/threads/bounded_queue.hpp"
#include "server/threads/monotonic_clock.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// Processor time that answers may take from the mapper: a planner's short question does not wait
/// for the end of a scan, and many clients cannot hold poses up. A token bucket: it holds `burst`
/// and fills by `cores`. Thread-safe.
class PromptBudget {
 public:
  struct Limits {
    std::chrono::nanoseconds burst = std::chrono::milliseconds(500);
    /// What answers that took longer than they were thought to may owe: more is forgotten.
    std::chrono::nanoseconds debt = std::chrono::seconds(15);
    /// Processor seconds a second.
    double cores = 0.25;
  };

  PromptBudget() : PromptBudget(Limits{}) {}
  explicit PromptBudget(const Limits& limits, MonotonicClock& clock = MonotonicClock::steady())
      : limits_(limits), clock_(clock), left_(limits.burst), filled_(clock.now()) {}

  [[nodiscard]] bool has_time();
  /// Answers that are under way may overdraw it, down to `debt`.
  void spend(std::chrono::nanoseconds processor_time);

 private:
  void fill();

  Limits limits_;
  MonotonicClock& clock_;
  std::mutex mutex_;
  std::chrono::nanoseconds left_;
  MonotonicClock::TimePoint filled_;
};

/// Runs the answers of one service: on the calling thread while the budget has time, else on a
/// thread of low priority, for whose end the caller waits. (Two threads, for Linux lets none raise
/// its own priority again.) oneTBB's workers go to the mapper first in both. One thread uses it.
class PromptTurns {
 public:
  /// `budget` must outlive it.
  PromptTurns(PromptBudget& budget, const std::string& name);

  /// Returns when `work` is done, and throws what it throws.
  void run(const std::function<void()>& work);

 private:
  PromptBudget& budget_;
  BoundedQueue<std::packaged_task<void()>> waiting_{1};
  // Last: stops before its queue is gone.
  Worker<std::packaged_task<void()>> low_priority_;
};

}  // namespace stillmap::server
