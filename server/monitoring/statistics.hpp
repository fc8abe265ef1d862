#pragma once

#include <chrono>
#include <deque>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/segmentation_pipeline.hpp"
#include "core/map/static_map.hpp"
#include "idl/interface/server_status.hpp"
#include "server/monitoring/duration_histogram.hpp"
#include "server/monitoring/latency_window.hpp"
#include "server/monitoring/recent_median.hpp"

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

/// Where the labels of the last scans came from.
class LabellingWindow {
 public:
  void add(Labelling labelling);
  /// 0 before the first.
  [[nodiscard]] double share(Labelling labelling) const;

 private:
  std::deque<Labelling> last_;
};

/// How long a stage took, over the last scans and since the start.
struct StageTimes {
  std::string stage;
  LatencyWindow recent;
  DurationHistogram all;
};

/// What the server counts and times. Thread-safe.
class Statistics {
 public:
  void scan_received();
  /// The last cloud named this frame, and came so much later than its stamp says.
  void scan_told(const std::string& frame, double delay_s);
  void scan_mapped(Labelling labelling);
  /// How scans are segmented from now on; the shares are not looked at.
  void segmenting(const SegmentationStatus& pace);
  /// The label source failed; `detail` is told in the status until it works again.
  void labels_failed(const std::string& detail);
  void labels_worked();
  /// Counts "dropped_<reason>"; the last `detail` is told in the status.
  void scans_dropped(const std::string& reason, std::size_t count, const std::string& detail);
  /// Counts an event that has nothing more to tell.
  void count(const std::string& event);
  void add_latency(const std::string& stage, double milliseconds);
  /// All that was done with a scan, without its labels, took so long.
  void scan_took_besides_labels(double milliseconds);

  /// What the static map takes now, and how many of its tiles cannot be read.
  void map_takes(const MemoryUse& memory, std::size_t unreadable_tiles);

  /// Fills in counters, rates, latencies and segmentation.
  void report_to(ServerStatus& status) const;

  /// In the order of first occurrence.
  [[nodiscard]] std::vector<StageTimes> stage_times() const;
  [[nodiscard]] MemoryUse map_memory() const;

  [[nodiscard]] std::uint64_t received() const;
  /// Mean time from scan to scan over the last seconds; 0 without scans.
  [[nodiscard]] double receive_period_ms() const;
  /// Median over the last scans of what is done with each but its labels; 0 before the first.
  [[nodiscard]] double besides_labels_ms() const;
  /// Why the last scan was dropped; empty once a later one was mapped.
  [[nodiscard]] std::string last_drop() const;
  /// Why the last segmentation failed; empty once a later one worked.
  [[nodiscard]] std::string last_label_failure() const;

 private:
  mutable std::mutex mutex_;
  std::uint64_t received_ = 0;
  std::uint64_t mapped_ = 0;
  // In the order of first occurrence.
  std::vector<NamedCounter> dropped_;
  std::vector<NamedCounter> events_;
  std::vector<StageTimes> stages_;
  RateWindow received_rate_;
  RateWindow mapped_rate_;
  std::string last_drop_;
  std::string scan_frame_;
  double scan_delay_s_ = 0.0;
  LabellingWindow labellings_;
  RecentMedian besides_labels_ms_{9};
  SegmentationStatus segmentation_;
  std::uint64_t label_failures_ = 0;
  MemoryUse map_memory_;
  std::size_t unreadable_tiles_ = 0;
  std::string last_label_failure_;
};

}  // namespace stillmap
