#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>

#include "server/threads/monotonic_clock.hpp"

namespace stillmap::test {

/// A clock for one sleeping thread, which the test advances by hand.
class ManualClock final : public server::MonotonicClock {
 public:
  [[nodiscard]] TimePoint now() const override {
    const std::scoped_lock lock(mutex_);
    return now_;
  }
  void sleep_until(TimePoint time, const std::stop_token& stop) override {
    std::unique_lock lock(mutex_);
    wake_time_ = time;
    changed_.notify_all();
    changed_.wait(lock, stop, [&] { return now_ >= time; });
    wake_time_.reset();
  }

  void advance(std::chrono::duration<double> time) {
    const std::scoped_lock lock(mutex_);
    now_ += std::chrono::duration_cast<TimePoint::duration>(time);
    changed_.notify_all();
  }
  /// Waits until a thread sleeps, and returns how much longer it will; nothing after a minute.
  [[nodiscard]] std::optional<std::chrono::duration<double>> wait_for_sleeper() {
    std::unique_lock lock(mutex_);
    const bool sleeps = changed_.wait_for(lock, std::chrono::minutes(1),
                                          [this] { return wake_time_ && *wake_time_ > now_; });
    if (!sleeps) return std::nullopt;
    return *wake_time_ - now_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  TimePoint now_{std::chrono::hours(1)};
  std::optional<TimePoint> wake_time_;
};

}  // namespace stillmap::test
