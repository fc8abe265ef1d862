#pragma once

#include <chrono>
#include <stop_token>

namespace stillmap::server {

/// Time for threads that sleep. Tests inject one that they advance by hand.
class MonotonicClock {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  virtual ~MonotonicClock() = default;
  [[nodiscard]] virtual TimePoint now() const = 0;
  /// Returns at `time`, or earlier when a stop is requested.
  virtual void sleep_until(TimePoint time, const std::stop_token& stop) = 0;

  /// std::chrono::steady_clock.
  [[nodiscard]] static MonotonicClock& steady();
};

}  // namespace stillmap::server
