#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/map/static_map.hpp"
#include "core/segmentation_pipeline.hpp"
#include "idl/interface/server_status.hpp"
#include "server/monitoring/recent_values.hpp"

namespace prometheus {
class Counter;
class Histogram;
}  // namespace prometheus

namespace stillmap::server {

class Metrics;

/// What the server counts and times: totals go to the metrics, and what the status shows of the
/// last seconds (rates, percentiles, texts) is kept here. Thread-safe.
class Statistics {
 public:
  Statistics();
  ~Statistics();

  [[nodiscard]] Metrics& metrics() { return *metrics_; }

  void scan_received();
  /// The last cloud named this frame, which is reported by its shown_name(), and came so much later
  /// than its stamp says.
  void record_scan_header(const std::string& frame, double delay_s);
  void scan_mapped(LabelProvenance label_provenance);
  /// How scans are segmented from now on; the shares are ignored.
  void set_segmentation_status(const dds::SegmentationStatus& segmentation);
  /// The label source failed; `detail` is told in the status until it works again.
  void segmentation_failed(const std::string& detail);
  void segmentation_succeeded();
  /// Counted by reason in the status; the last `detail` is told there, too.
  void scans_dropped(const std::string& reason, std::size_t count, const std::string& detail);
  /// A cloud that is no scan; fault: "no_xyz". Its scan counts as dropped besides.
  void bad_cloud(const std::string& fault);
  /// A sweep that was put together without this lidar: "sweeps_without" in the status.
  void sweep_without(const std::string& lidar);
  /// So many were published and did not arrive: "scans_lost" in the status.
  void scans_lost(std::uint64_t count);
  /// Counts an event that has nothing more to tell.
  void count(const std::string& event, std::uint64_t times = 1);
  void add_latency(const std::string& stage, double milliseconds);
  /// Everything that was done with a scan, without its segmentation, took so long.
  void record_other_stages(double milliseconds);
  void map_saved(double seconds);
  /// `why` is told in the status until a save succeeds.
  void map_save_failed(const std::string& why);
  /// Told there also while saves succeed: which file they do not go to. Empty: they go where they
  /// should.
  void set_map_displaced(const std::string& text);
  /// Told there, too: what killed servers left of maps, in words. Empty: nothing.
  void set_maps_left(const std::string& text);

  /// Why an input that helps the lidar ("gnss", "odometry prior") is of no use; empty: it is.
  void set_input_fault(const std::string& input, const std::string& why);
  /// All of them.
  [[nodiscard]] std::string input_faults() const;

  /// The lidar that scans are taken to come from; empty until its scans have told it.
  void set_sensor(const std::string& name);
  [[nodiscard]] std::string sensor() const;

  /// How the search for a lidar that is lost goes, in words; empty: there is none.
  void set_place_search(const std::string& text);

  /// What the static map takes now, and how many of its tiles cannot be read.
  void set_map_memory(const MemoryUse& memory, std::size_t unreadable_tiles);

  /// Fills in counters, rates, latencies and segmentation.
  void report_to(dds::ServerStatus& status) const;

  [[nodiscard]] std::uint64_t received() const;
  /// Mean time from scan to scan over the last seconds; 0 without scans.
  [[nodiscard]] double receive_period_ms() const;
  /// Median over the last scans of what is done with each but its segmentation; 0 before the first.
  [[nodiscard]] double other_stages_ms() const;
  /// When the server began: before it read the map file and joined the domain.
  [[nodiscard]] std::chrono::steady_clock::time_point started() const { return started_; }
  /// Why the last scan was dropped; empty once a later one was mapped.
  [[nodiscard]] std::string last_drop() const;
  /// Why the last save of the map failed; empty once a later one succeeded.
  [[nodiscard]] std::string last_save_failure() const;
  [[nodiscard]] std::string map_displaced() const;
  [[nodiscard]] std::string maps_left() const;
  [[nodiscard]] std::string place_search() const;
  /// Why the last segmentation failed; empty once a later one worked.
  [[nodiscard]] std::string last_segmentation_failure() const;

 private:
  /// By the value of their label, in the order of first occurrence.
  using Counters = std::vector<std::pair<std::string, prometheus::Counter*>>;
  struct Stage {
    std::string name;
    LatencyWindow recent;
    prometheus::Histogram* all;
  };

  [[nodiscard]] std::vector<dds::NamedCounter> counters() const;

  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::unique_ptr<Metrics> metrics_;
  mutable std::mutex mutex_;
  Counters dropped_;
  Counters bad_clouds_;
  Counters sweeps_without_;
  Counters events_;
  // In the order of first occurrence.
  std::vector<Stage> stages_;
  RateWindow received_rate_;
  RateWindow mapped_rate_;
  std::string last_drop_;
  std::string scan_frame_;
  double scan_delay_s_ = 0.0;
  LabelProvenanceWindow label_provenances_;
  RecentMedian other_stages_ms_{9};
  dds::SegmentationStatus segmentation_;
  std::string last_segmentation_failure_;
  std::string last_save_failure_;
  std::string map_displaced_;
  std::string maps_left_;
  std::string sensor_;
  std::string place_search_;
  std::map<std::string, std::string> input_faults_;
};

}  // namespace stillmap::server
