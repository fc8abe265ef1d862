#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace stillmap::cli {

/// When the scans of a recording are due, from the steps between their stamps. Where a recording
/// goes on after a pause, or its clock was set, max_pause of it are waited at most; where its clock
/// was set back by more than that, the next scan is due at once and those after it at their steps.
class ReplayClock {
 public:
  using Clock = std::chrono::steady_clock;

  /// Longer than what drivers lose, shorter than what people wait for.
  static constexpr std::chrono::seconds max_pause{10};
  /// Between two scans, however small the rate.
  static constexpr std::chrono::hours max_wait{24};

  /// `rate` times real time; 0: everything is due at once.
  ReplayClock(Clock::time_point began, std::int64_t first_stamp_ns, double rate)
      : due_(began), rate_(rate), previous_ns_(first_stamp_ns) {}

  /// Of the next scan.
  [[nodiscard]] Clock::time_point due(std::int64_t stamp_ns) {
    if (rate_ > 0.0) {
      // Stamps of broken recordings may be farther apart than an integer holds.
      const double step_ns = static_cast<double>(stamp_ns) - static_cast<double>(previous_ns_);
      constexpr double max_step_ns = std::chrono::duration<double, std::nano>(max_pause).count();
      constexpr double max_wait_ns = std::chrono::duration<double, std::nano>(max_wait).count();
      // Stamps that are out of order step back and forth; a clock that was set goes on from there.
      const double counted_ns = step_ns < -max_step_ns ? 0.0 : std::min(step_ns, max_step_ns);
      const double wait_ns = std::clamp(counted_ns / rate_, -max_wait_ns, max_wait_ns);
      due_ += std::chrono::nanoseconds(static_cast<std::int64_t>(wait_ns));
    }
    previous_ns_ = stamp_ns;
    return due_;
  }

 private:
  Clock::time_point due_;
  double rate_;
  std::int64_t previous_ns_;
};

}  // namespace stillmap::cli
