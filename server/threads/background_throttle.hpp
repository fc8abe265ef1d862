#pragma once

#include <atomic>
#include <chrono>
#include <functional>

#include "core/map/throttle_callback.hpp"
#include "server/threads/monotonic_clock.hpp"

namespace stillmap::server {

/// Processor time of the calling thread, which stands still while the scheduler prefers others.
[[nodiscard]] std::chrono::nanoseconds thread_cpu_time();

/// When a background thread runs: beside all others, or on busy cores a tenth as much as those, by
/// its nice value, or, by SCHED_IDLE, there only when no other thread wants to.
enum class BackgroundScheduling { normal, low, idle };

/// Applies it to the calling thread, for good. False where the system refuses.
bool use_scheduling(BackgroundScheduling scheduling);
/// Starts oneTBB's workers, which inherit the calling thread's scheduling and keep it: were a
/// background thread the first to need them, the mapper's work would be done at low priority, too.
void start_tbb_workers();
/// Runs the parallel loops of `work` on oneTBB's workers that the mapper leaves idle.
void run_behind_the_mapper(const std::function<void()>& work);
/// Gives all threads of this process that have idle scheduling the normal one. Where other programs
/// keep all cores busy, a thread of idle priority needs minutes for what is left of its work.
void end_idle_scheduling();

/// Whether a scan is being mapped, so that background work waits for the time between scans. Idle
/// scheduling alone is not enough: cores share caches, memory bandwidth and often arithmetic units,
/// so that a background thread slows the mapper down even on another core. Thread-safe and without
/// locks: the mapper never waits for a background thread.
class BackgroundThrottle {
 public:
  /// Marks a scan as being mapped while it lives.
  class ScanInProgress {
   public:
    explicit ScanInProgress(BackgroundThrottle& throttle) : throttle_(throttle) {
      ++throttle_.scans_in_progress_;
    }
    ~ScanInProgress() { --throttle_.scans_in_progress_; }
    ScanInProgress(const ScanInProgress&) = delete;
    ScanInProgress& operator=(const ScanInProgress&) = delete;

   private:
    BackgroundThrottle& throttle_;
  };

  [[nodiscard]] bool is_idle() const { return scans_in_progress_ == 0 || is_released_; }

  /// Lets all background work run from now on, none of it only while cores are idle: the server
  /// ends, and its threads are to finish. Low priority stays; no thread may raise its own.
  void release() {
    is_released_ = true;
    end_idle_scheduling();
  }

 private:
  std::atomic<bool> is_released_ = false;
  std::atomic<int> scans_in_progress_ = 0;
};

/// Releases the throttle when destroyed, so that threads that wait for it can end.
class ThrottleRelease {
 public:
  explicit ThrottleRelease(BackgroundThrottle& throttle) : throttle_(throttle) {}
  ~ThrottleRelease() { throttle_.release(); }
  ThrottleRelease(const ThrottleRelease&) = delete;
  ThrottleRelease& operator=(const ThrottleRelease&) = delete;

 private:
  BackgroundThrottle& throttle_;
};

/// What a background thread does when scans come as fast as they can be mapped, without gaps.
enum class SaturationPolicy {
  wait,
  /// It still works a tenth of the time, if the scheduler grants it.
  run_at_ten_percent,
};

/// For one background thread: returns when no scan is being mapped. `throttle` and `clock` must
/// outlive it.
[[nodiscard]] ThrottleCallback make_throttle_callback(
    const BackgroundThrottle& throttle, SaturationPolicy saturation_policy,
    MonotonicClock& clock = MonotonicClock::steady());

}  // namespace stillmap::server
