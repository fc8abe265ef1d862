#pragma once

#include <chrono>
#include <deque>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "idl/server_status.hpp"
#include "server/latency_window.hpp"

namespace stillmap {

/// Events a second over the last few seconds.
class RateWindow {
 public:
  using Clock = std::chrono::steady_clock;
  void add(Clock::time_point event);
  [[nodiscard]] double rate_hz(Clock::time_point now) const;

 private:
  std::deque<Clock::time_point> events_;
};

/// What the server counts and times. Thread-safe.
class Statistics {
 public:
  void scan_received();
  void scan_mapped();
  /// Counts "dropped_<reason>"; the last `detail` is told in the status.
  void scans_dropped(const std::string& reason, std::size_t count, const std::string& detail);
  void add_latency(const std::string& stage, double milliseconds);

  /// Fills in counters, rates and latencies.
  void report_to(ServerStatus& status) const;

  [[nodiscard]] std::uint64_t received() const;
  /// Why the last scan was dropped; empty once a later one was mapped.
  [[nodiscard]] std::string last_drop() const;

 private:
  mutable std::mutex mutex_;
  std::uint64_t received_ = 0;
  std::uint64_t mapped_ = 0;
  // In the order of first occurrence.
  std::vector<NamedCounter> dropped_;
  std::vector<std::pair<std::string, LatencyWindow>> latencies_;
  RateWindow received_rate_;
  RateWindow mapped_rate_;
  std::string last_drop_;
};

}  // namespace stillmap
