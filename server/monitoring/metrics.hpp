#pragma once

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <mutex>
#include <string>
#include <vector>

#include "idl/interface/server_status.hpp"

namespace stillmap::server {

/// Everything that the server counts and times, in one registry of Prometheus's client library:
/// each value is written where it arises, and read from here for /metrics and for the status.
/// Base units, counters end in _total; a family's members differ by labels. Thread-safe.
class Metrics {
 public:
  using Counters = prometheus::Family<prometheus::Counter>;
  using Gauges = prometheus::Family<prometheus::Gauge>;
  using Histograms = prometheus::Family<prometheus::Histogram>;

  Metrics();

  /// Durations share one set of buckets.
  [[nodiscard]] static prometheus::Histogram& add_durations(Histograms& family,
                                                            const prometheus::Labels& labels);

  /// All families; first sets those that show the status and the process as they are now.
  [[nodiscard]] std::vector<prometheus::MetricFamily> collect(const dds::ServerStatus& status);

 private:
  prometheus::Registry registry_;

 public:
  prometheus::Counter& scans_received;
  prometheus::Counter& scans_mapped;
  prometheus::Counter& scans_lost;
  /// Labels: reason.
  Counters& scans_dropped;
  /// Labels: fault.
  Counters& bad_clouds;
  /// Labels: lidar.
  Counters& sweeps_without;
  /// Labels: event.
  Counters& events;
  prometheus::Counter& label_failures;
  /// Labels: stage.
  Histograms& stage_durations;
  prometheus::Gauge& map_memory_bytes;
  prometheus::Gauge& map_tiles_evicted;
  prometheus::Gauge& map_tiles_unreadable;
  /// Labels: service, code.
  Counters& service_requests;
  /// Labels: service.
  Histograms& service_durations;
  prometheus::Histogram& checkpoint_durations;
  prometheus::Counter& checkpoint_failures;
  /// Since the last success.
  prometheus::Gauge& checkpoints_failing;
  /// Seconds of Unix time.
  prometheus::Gauge& last_checkpoint;

 private:
  void show(const dds::ServerStatus& status);
  void show_process();
  void show_service_faults(const dds::ServerStatus& status);

  // Set by `collect` alone, for one caller at a time.
  std::mutex collect_mutex_;
  Gauges& info_;
  prometheus::Gauge* shown_info_ = nullptr;
  prometheus::Gauge& uptime_;
  Gauges& odometry_health_;
  prometheus::Gauge& segmentation_every_;
  prometheus::Gauge& segmentation_columns_;
  Gauges& scan_labels_;
  Counters& service_faults_;
  prometheus::Gauge& map_tiles_;
  prometheus::Gauge& map_voxels_;
  prometheus::Gauge& resident_memory_;
  prometheus::Counter& cpu_seconds_;
  prometheus::Gauge& open_files_;
};

}  // namespace stillmap::server
