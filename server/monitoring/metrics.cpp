#include "server/monitoring/metrics.hpp"

#include <prometheus/metric_family.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <string>
#include <utility>

namespace stillmap::server {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

/// A family with one way to fill each kind of metric.
class Family {
 public:
  Family(std::string name, std::string help, MetricType type)
      : family_{std::move(name), std::move(help), type, {}} {}

  Family& add(double value, Labels labels = {}) {
    ClientMetric& metric = family_.metric.emplace_back();
    metric.label = std::move(labels);
    metric.counter.value = metric.gauge.value = value;
    return *this;
  }

  Family& add(const DurationHistogram& durations, Labels labels = {}) {
    ClientMetric& metric = family_.metric.emplace_back();
    metric.label = std::move(labels);
    metric.histogram.sample_count = durations.count();
    metric.histogram.sample_sum = durations.sum_s();
    for (std::size_t i = 0; i < DurationHistogram::bounds_s.size(); ++i) {
      metric.histogram.bucket.push_back(
          {durations.count_up_to(i), DurationHistogram::bounds_s.at(i)});
    }
    return *this;
  }

  operator MetricFamily() const { return family_; }

 private:
  MetricFamily family_;
};

Family counter(const std::string& name, const std::string& help) {
  return {"stillmap_" + name, help, MetricType::Counter};
}
Family gauge(const std::string& name, const std::string& help) {
  return {"stillmap_" + name, help, MetricType::Gauge};
}
Family histogram(const std::string& name, const std::string& help) {
  return {"stillmap_" + name, help, MetricType::Histogram};
}

constexpr std::string_view drop_prefix = "dropped_";
/// Counters of the status that have a family of their own.
constexpr std::array own_family{"scans_received", "scans_mapped",   "label_failures",
                                "map_memory_kib", "map_tiles_away", "map_tiles_unreadable"};

double count(const dds::ServerStatus& status, std::string_view name) {
  return static_cast<double>(status.counter(name));
}

MetricFamily drops(const dds::ServerStatus& status) {
  Family family = counter("scans_dropped_total", "Scans that were not mapped, by reason");
  for (const dds::NamedCounter& dropped : status.counters) {
    if (!dropped.name.starts_with(drop_prefix)) continue;
    family.add(static_cast<double>(dropped.value),
               {{"reason", dropped.name.substr(drop_prefix.size())}});
  }
  return family;
}

MetricFamily events(const dds::ServerStatus& status) {
  Family family = counter("events_total", "What happened beside mapping, by event");
  for (const dds::NamedCounter& event : status.counters) {
    if (event.name.starts_with(drop_prefix)) continue;
    if (std::ranges::find(own_family, event.name) != own_family.end()) continue;
    family.add(static_cast<double>(event.value), {{"event", event.name}});
  }
  return family;
}

MetricFamily odometry_health(const dds::ServerStatus& status) {
  Family family = gauge("odometry_health", "1 for the state of the last mapped scan's odometry");
  using enum OdometryHealth;
  for (const OdometryHealth health : {initialised, good, degenerate, lost}) {
    family.add(status.health == health ? 1.0 : 0.0, {{"state", name(health)}});
  }
  return family;
}

MetricFamily label_shares(const dds::SegmentationStatus& segmentation) {
  return gauge("scan_labels_ratio", "Share of the last scans whose labels came from there")
      .add(segmentation.fresh_share, {{"source", "own"}})
      .add(segmentation.propagated_share, {{"source", "carried"}})
      .add(segmentation.unlabelled_share, {{"source", "none"}});
}

MetricFamily stages(const std::vector<StageStatistics>& stages) {
  Family family = histogram("stage_duration_seconds", "Time that a stage took for a scan");
  for (const StageStatistics& times : stages) family.add(times.all, {{"stage", times.stage}});
  return family;
}

MetricFamily answers(const MetricsSnapshot& snapshot) {
  Family family = counter("service_requests_total", "Requests answered, by service and code");
  for (const auto& [service, log] : snapshot.services) {
    for (const auto& [code, answered] : log.answers) {
      family.add(static_cast<double>(answered), {{"service", service}, {"code", name(code)}});
    }
  }
  return family;
}

MetricFamily answer_times(const MetricsSnapshot& snapshot) {
  Family family = histogram("service_duration_seconds", "Time to make an answer, without its way");
  for (const auto& [service, log] : snapshot.services) {
    family.add(log.times, {{"service", service}});
  }
  return family;
}

double unix_seconds(const CheckpointLog::Record& checkpoints) {
  if (!checkpoints.last_stored) return 0.0;
  return std::chrono::duration<double>(checkpoints.last_stored->time_since_epoch()).count();
}

void add_scans(std::vector<MetricFamily>& all, const dds::ServerStatus& status) {
  all.push_back(
      counter("scans_received_total", "Scans that arrived").add(count(status, "scans_received")));
  all.push_back(
      counter("scans_mapped_total", "Scans that were mapped").add(count(status, "scans_mapped")));
  all.push_back(drops(status));
  all.push_back(events(status));
  all.push_back(odometry_health(status));
  all.push_back(counter("label_failures_total", "Scans whose segmentation failed")
                    .add(count(status, "label_failures")));
  all.push_back(gauge("segmentation_every_scans", "n, when every n-th scan is segmented")
                    .add(status.segmentation.every));
  all.push_back(gauge("segmentation_image_columns", "Width of the range images; 0: none")
                    .add(status.segmentation.image_columns));
  all.push_back(label_shares(status.segmentation));
}

void add_map(std::vector<MetricFamily>& all, const MetricsSnapshot& snapshot) {
  const dds::ServerStatus& status = snapshot.status;
  all.push_back(
      gauge("map_tiles", "Tiles of the static map").add(static_cast<double>(status.tile_count)));
  all.push_back(
      gauge("map_voxels", "Voxels of the static map").add(static_cast<double>(status.voxel_count)));
  all.push_back(gauge("map_memory_bytes", "What the static map takes, at the last checkpoint")
                    .add(static_cast<double>(snapshot.map_memory.bytes)));
  all.push_back(gauge("map_tiles_away", "Tiles that are on disk only, at the last checkpoint")
                    .add(static_cast<double>(snapshot.map_memory.non_resident_tiles)));
  all.push_back(gauge("map_tiles_unreadable", "Tiles on disk that cannot be read")
                    .add(count(status, "map_tiles_unreadable")));
}

void add_checkpoints(std::vector<MetricFamily>& all, const CheckpointLog::Record& checkpoints) {
  all.push_back(histogram("checkpoint_duration_seconds", "Time that saving the map took")
                    .add(checkpoints.times));
  all.push_back(counter("checkpoint_failures_total", "Saves of the map that failed")
                    .add(static_cast<double>(checkpoints.failures)));
  all.push_back(gauge("checkpoint_last_success_timestamp_seconds",
                      "Unix time of the last save; 0 before the first")
                    .add(unix_seconds(checkpoints)));
}

void add_process(std::vector<MetricFamily>& all, const MetricsSnapshot& snapshot) {
  // Names that every client library of Prometheus gives them.
  const ProcessUse& process = snapshot.process;
  all.push_back(Family("process_resident_memory_bytes", "Memory of the process", MetricType::Gauge)
                    .add(process.resident_bytes));
  all.push_back(
      Family("process_cpu_seconds_total", "Processor time of the process", MetricType::Counter)
          .add(process.cpu_seconds));
  all.push_back(Family("process_open_fds", "Files and sockets that are open", MetricType::Gauge)
                    .add(process.open_files));
}

}  // namespace

std::vector<MetricFamily> metric_families(const MetricsSnapshot& snapshot) {
  const dds::ServerStatus& status = snapshot.status;
  std::vector<MetricFamily> all;
  all.push_back(gauge("info", "1; what runs")
                    .add(1.0, {{"version", status.software_version},
                               {"delivery", name(status.delivery)},
                               {"label_source", status.label_source}}));
  all.push_back(gauge("uptime_seconds", "Since the start").add(status.uptime_s));
  add_scans(all, status);
  all.push_back(stages(snapshot.stages));
  add_map(all, snapshot);
  all.push_back(answers(snapshot));
  all.push_back(answer_times(snapshot));
  add_checkpoints(all, snapshot.checkpoints);
  add_process(all, snapshot);
  return all;
}

}  // namespace stillmap::server
