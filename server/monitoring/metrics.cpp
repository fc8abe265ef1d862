#include "server/monitoring/metrics.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace stillmap::server {
namespace {

Metrics::Counters& counters(prometheus::Registry& registry, const std::string& name,
                            const std::string& help) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
}
Metrics::Gauges& gauges(prometheus::Registry& registry, const std::string& name,
                        const std::string& help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
}
Metrics::Histograms& histograms(prometheus::Registry& registry, const std::string& name,
                                const std::string& help) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry);
}
prometheus::Counter& counter(prometheus::Registry& registry, const std::string& name,
                             const std::string& help) {
  return counters(registry, name, help).Add({});
}
prometheus::Gauge& gauge(prometheus::Registry& registry, const std::string& name,
                         const std::string& help) {
  return gauges(registry, name, help).Add({});
}

double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0.0;
  double resident_pages = 0.0;
  statm >> total_pages >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double open_files() {
  std::error_code none;
  const std::filesystem::directory_iterator files("/proc/self/fd", none);
  return static_cast<double>(std::distance(begin(files), end(files)));
}

}  // namespace

// The process_ families have the names that every client library of Prometheus gives them.
Metrics::Metrics()
    : scans_received(counter(registry_, "stillmap_scans_received_total", "Scans that arrived")),
      scans_mapped(counter(registry_, "stillmap_scans_mapped_total", "Scans that were mapped")),
      scans_lost(counter(registry_, "stillmap_scans_lost_total",
                         "Scans that were published and did not arrive")),
      scans_dropped(counters(registry_, "stillmap_scans_dropped_total",
                             "Scans that were not mapped, by reason")),
      bad_clouds(counters(registry_, "stillmap_bad_clouds_total",
                          "Clouds that could not be read as scans, by fault")),
      sweeps_without(counters(registry_, "stillmap_sweeps_without_total",
                              "Sweeps that a lidar had no scan in, by lidar")),
      events(
          counters(registry_, "stillmap_events_total", "What happened beside mapping, by event")),
      label_failures(
          counter(registry_, "stillmap_label_failures_total", "Scans whose segmentation failed")),
      stage_durations(histograms(registry_, "stillmap_stage_duration_seconds",
                                 "Time that a stage took for a scan")),
      map_memory_bytes(gauge(registry_, "stillmap_map_memory_bytes",
                             "What the static map takes, at the last checkpoint")),
      map_tiles_evicted(gauge(registry_, "stillmap_map_tiles_evicted",
                              "Tiles that are on disk only, at the last checkpoint")),
      map_tiles_unreadable(
          gauge(registry_, "stillmap_map_tiles_unreadable", "Tiles on disk that cannot be read")),
      service_requests(counters(registry_, "stillmap_service_requests_total",
                                "Requests answered, by service and code")),
      service_durations(histograms(registry_, "stillmap_service_duration_seconds",
                                   "Time to make an answer, without its way")),
      checkpoint_durations(
          add_durations(histograms(registry_, "stillmap_checkpoint_duration_seconds",
                                   "Time that saving the map took"),
                        {})),
      checkpoint_failures(
          counter(registry_, "stillmap_checkpoint_failures_total", "Saves of the map that failed")),
      checkpoints_failing(gauge(registry_, "stillmap_checkpoints_failing",
                                "Saves of the map that failed since the last one that did not")),
      last_checkpoint(gauge(registry_, "stillmap_checkpoint_last_success_timestamp_seconds",
                            "Unix time of the last save; 0 before the first")),
      info_(gauges(registry_, "stillmap_info", "1; what runs")),
      uptime_(gauge(registry_, "stillmap_uptime_seconds", "Since the start")),
      odometry_health_(gauges(registry_, "stillmap_odometry_health",
                              "1 for the state of the last mapped scan's odometry")),
      segmentation_every_(gauge(registry_, "stillmap_segmentation_every_scans",
                                "n, when every n-th scan is segmented")),
      segmentation_columns_(gauge(registry_, "stillmap_segmentation_image_columns",
                                  "Width of the range images; 0: none")),
      scan_labels_(gauges(registry_, "stillmap_scan_labels_ratio",
                          "Share of the last scans whose labels came from there")),
      service_faults_(counters(registry_, "stillmap_service_faults_total",
                               "Requests that got no answer, by service and fault")),
      map_tiles_(gauge(registry_, "stillmap_map_tiles", "Tiles of the static map")),
      map_voxels_(gauge(registry_, "stillmap_map_voxels", "Voxels of the static map")),
      resident_memory_(gauge(registry_, "process_resident_memory_bytes", "Memory of the process")),
      cpu_seconds_(
          counter(registry_, "process_cpu_seconds_total", "Processor time of the process")),
      open_files_(gauge(registry_, "process_open_fds", "Files and sockets that are open")) {}

prometheus::Histogram& Metrics::add_durations(Histograms& family,
                                              const prometheus::Labels& labels) {
  return family.Add(
      labels, prometheus::Histogram::BucketBoundaries{0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1,
                                                      0.25, 0.5, 1.0, 2.5, 5.0, 10.0});
}

std::vector<prometheus::MetricFamily> Metrics::collect(const dds::ServerStatus& status) {
  const std::scoped_lock lock(collect_mutex_);
  show(status);
  show_process();
  return registry_.Collect();
}

void Metrics::show(const dds::ServerStatus& status) {
  // The label source can change while the server runs: the old series must not stay beside the new.
  prometheus::Gauge& info = info_.Add({{"version", status.software_version},
                                       {"delivery", name(status.delivery)},
                                       {"label_source", status.label_source}});
  if (shown_info_ != nullptr && shown_info_ != &info) info_.Remove(shown_info_);
  shown_info_ = &info;
  info.Set(1.0);
  uptime_.Set(status.uptime_s);
  using enum OdometryHealth;
  for (const OdometryHealth health : {initialised, good, degenerate, lost}) {
    odometry_health_.Add({{"state", name(health)}}).Set(status.health == health ? 1.0 : 0.0);
  }
  const dds::SegmentationStatus& segmentation = status.segmentation;
  segmentation_every_.Set(segmentation.interval);
  segmentation_columns_.Set(segmentation.image_columns);
  scan_labels_.Add({{"source", "segmented"}}).Set(segmentation.fresh_share);
  scan_labels_.Add({{"source", "propagated"}}).Set(segmentation.propagated_share);
  scan_labels_.Add({{"source", "none"}}).Set(segmentation.unlabelled_share);
  map_tiles_.Set(static_cast<double>(status.tile_count));
  map_voxels_.Set(static_cast<double>(status.voxel_count));
  show_service_faults(status);
}

void Metrics::show_service_faults(const dds::ServerStatus& status) {
  for (const auto& [fault, service, count] : status.service_faults) {
    prometheus::Counter& shown = service_faults_.Add({{"service", service}, {"fault", fault}});
    shown.Increment(static_cast<double>(count) - shown.Value());
  }
}

void Metrics::show_process() {
  resident_memory_.Set(resident_bytes());
  cpu_seconds_.Increment(processor_seconds() - cpu_seconds_.Value());
  open_files_.Set(open_files());
}

}  // namespace stillmap::server
