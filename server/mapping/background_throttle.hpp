#pragma once

#include <atomic>

#include "core/throttle_callback.hpp"

namespace stillmap {

/// Whether a scan is in work, so that what is done in the background waits for a gap. Two cores
/// share caches, memory and often one core's arithmetic: a thread that gets only the time that
/// nobody else wants slows the others down all the same. Thread-safe, without locks: the mapper
/// never waits for a thread that it holds up.
class ScanTraffic {
 public:
  /// While it lives, a scan is in work.
  class InWork {
   public:
    explicit InWork(ScanTraffic& traffic) : traffic_(traffic) { ++traffic_.in_work_; }
    ~InWork() { --traffic_.in_work_; }
    InWork(const InWork&) = delete;
    InWork& operator=(const InWork&) = delete;

   private:
    ScanTraffic& traffic_;
  };

  [[nodiscard]] bool is_quiet() const { return in_work_ == 0 || has_ended_; }

  /// Holds up nobody any more: the server ends, and background work is to be finished.
  void end() { has_ended_ = true; }

 private:
  std::atomic<bool> has_ended_ = false;
  std::atomic<int> in_work_ = 0;
};

/// Ends the traffic when it goes, so that threads that wait for gaps can go, too.
class TrafficEnd {
 public:
  explicit TrafficEnd(ScanTraffic& traffic) : traffic_(traffic) {}
  ~TrafficEnd() { traffic_.end(); }
  TrafficEnd(const TrafficEnd&) = delete;
  TrafficEnd& operator=(const TrafficEnd&) = delete;

 private:
  ScanTraffic& traffic_;
};

/// What a background thread does where scans come as fast as they can be mapped and leave no gaps.
enum class WithoutGaps {
  wait,
  /// It still works a tenth of the time, if it gets it.
  work_a_tenth,
};

/// For one background thread: waits for a gap between scans. `traffic` must outlive it.
[[nodiscard]] Pause give_way_to(const ScanTraffic& traffic, WithoutGaps without_gaps);

}  // namespace stillmap
