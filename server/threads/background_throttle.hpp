#pragma once

#include <atomic>

#include "core/map/throttle_callback.hpp"

namespace stillmap::server {

/// Whether a scan is in work, so that what is done in the background waits for a gap. Two cores
/// share caches, memory and often one core's arithmetic: a thread that gets only the time that
/// nobody else wants slows the others down all the same. Thread-safe, without locks: the mapper
/// never waits for a thread that it holds up.
class BackgroundThrottle {
 public:
  /// While it lives, a scan is in work.
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

  /// Holds up nobody any more: the server ends, and background work is to be finished.
  void release() { is_released_ = true; }

 private:
  std::atomic<bool> is_released_ = false;
  std::atomic<int> scans_in_progress_ = 0;
};

/// Releases the throttle when it goes, so that threads that wait for gaps can go, too.
class ThrottleRelease {
 public:
  explicit ThrottleRelease(BackgroundThrottle& throttle) : throttle_(throttle) {}
  ~ThrottleRelease() { throttle_.release(); }
  ThrottleRelease(const ThrottleRelease&) = delete;
  ThrottleRelease& operator=(const ThrottleRelease&) = delete;

 private:
  BackgroundThrottle& throttle_;
};

/// What a background thread does where scans come as fast as they can be mapped and leave no gaps.
enum class SaturationPolicy {
  wait,
  /// It still works a tenth of the time, if it gets it.
  run_at_ten_percent,
};

/// For one background thread: waits for a gap between scans. `throttle` must outlive it.
[[nodiscard]] ThrottleCallback make_throttle_callback(const BackgroundThrottle& throttle,
                                                      SaturationPolicy saturation_policy);

}  // namespace stillmap::server
