#pragma once

#include <chrono>
#include <deque>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/map/static_map.hpp"
#include "core/segmentation_pipeline.hpp"
#include "idl/interface/server_status.hpp"
#include "server/monitoring/duration_histogram.hpp"
#include "server/monitoring/recent_median.hpp"
#include "server/monitoring/recent_values.hpp"

namespace stillmap::server {

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
class LabelProvenanceWindow {
 public:
  void add(LabelProvenance label_provenance);
  /// 0 before the first.
  [[nodiscard]] double share(LabelProvenance label_provenance) const;

 private:
  std::deque<LabelProvenance> last_;
};

/// How long a stage took, over the last scans and since the start.
struct StageStatistics {
  std::string stage;
  LatencyWindow recent;
  DurationHistogram all;
};

/// What the server counts and times. Thread-safe.
class Statistics {
 public:
  void scan_received();
  /// The last cloud named this frame, and came so much later than its stamp says.
  void record_scan_header(const std::string& frame, double delay_s);
  void scan_mapped(LabelProvenance label_provenance);
  /// How scans are segmented from now on; the shares are not looked at.
  void set_segmentation_status(const dds::SegmentationStatus& pace);
  /// The label source failed; `detail` is told in the status until it works again.
  void segmentation_failed(const std::string& detail);
  void segmentation_succeeded();
  /// Counts "dropped_<reason>"; the last `detail` is told in the status.
  void scans_dropped(const std::string& reason, std::size_t count, const std::string& detail);
  /// Counts an event that has nothing more to tell.
  void count(const std::string& event);
  void add_latency(const std::string& stage, double milliseconds);
  /// All that was done with a scan, without its labels, took so long.
  void record_other_stages(double milliseconds);

  /// What the static map takes now, and how many of its tiles cannot be read.
  void set_map_memory(const MemoryUse& memory, std::size_t unreadable_tiles);

  /// Fills in counters, rates, latencies and segmentation.
  void report_to(dds::ServerStatus& status) const;

  /// In the order of first occurrence.
  [[nodiscard]] std::vector<StageStatistics> stage_statistics() const;
  [[nodiscard]] MemoryUse map_memory() const;

  [[nodiscard]] std::uint64_t received() const;
  /// Mean time from scan to scan over the last seconds; 0 without scans.
  [[nodiscard]] double receive_period_ms() const;
  /// Median over the last scans of what is done with each but its labels; 0 before the first.
  [[nodiscard]] double other_stages_ms() const;
  /// Why the last scan was dropped; empty once a later one was mapped.
  [[nodiscard]] std::string last_drop() const;
  /// Why the last segmentation failed; empty once a later one worked.
  [[nodiscard]] std::string last_segmentation_failure() const;

 private:
  mutable std::mutex mutex_;
  std::uint64_t received_ = 0;
  std::uint64_t mapped_ = 0;
  // In the order of first occurrence.
  std::vector<dds::NamedCounter> dropped_;
  std::vector<dds::NamedCounter> events_;
  std::vector<StageStatistics> stages_;
  RateWindow received_rate_;
  RateWindow mapped_rate_;
  std::string last_drop_;
  std::string scan_frame_;
  double scan_delay_s_ = 0.0;
  LabelProvenanceWindow label_provenances_;
  RecentMedian other_stages_ms_{9};
  dds::SegmentationStatus segmentation_;
  std::uint64_t segmentation_failures_ = 0;
  MemoryUse map_memory_;
  std::size_t unreadable_tiles_ = 0;
  std::string last_segmentation_failure_;
};

}  // namespace stillmap::server
