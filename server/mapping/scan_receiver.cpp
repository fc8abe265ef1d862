#include "server/mapping/scan_receiver.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "core/lidar/sensor_fit.hpp"
#include "idl/conversions/header.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::server {
namespace {

// A reliable KEEP_ALL reader of fewer samples stalls while it assembles fragments.
constexpr int min_samples = 4;
// The sensor does not change from scan to scan.
constexpr std::uint64_t scans_between_checks = 100;

dds::TopicSpec<sensor_msgs::msg::PointCloud2> points_of(const ServerConfig& config) {
  const int waiting = std::max(static_cast<int>(config.input.queue_length), min_samples);
  return dds::points_topic(config.topics.points, config.input.delivery, waiting);
}

wire::CloudReadOptions reading_of(const ServerConfig& config) {
  return {.fields = config.input.fields,
          .intensity_scale = config.mapper.sensor.intensity_scale,
          .labels_are_classes = config.input.label_kind == LabelKind::classes};
}

// By this machine's clock; 0 for a stamp that is not a time.
double seconds_since(const builtin_interfaces::msg::Time& stamp) {
  const auto now = std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch());
  const std::int64_t stamp_ns = wire::stamp_ns(stamp).value_or(now.count());
  return 1e-9 * static_cast<double>(now.count() - stamp_ns);
}

}  // namespace

ScanReceiver::ScanReceiver(dds::Participant& participant, const ServerConfig& config,
                           ScanQueue& queue, Statistics& statistics)
    : topic_(points_of(config).dds_name),
      domain_id_(config.dds.domain_id),
      delivery_(config.input.delivery),
      sensor_(config.mapper.sensor),
      cloud_reader_(reading_of(config)),
      queue_(queue),
      statistics_(statistics),
      reader_(participant, topic_, points_of(config).reader),
      worker_(std::chrono::seconds(0),
              [this, cloud = sensor_msgs::msg::PointCloud2()](const std::stop_token& stop) mutable {
                if (reader_.take(cloud, stop, std::chrono::seconds(1))) accept(cloud, stop);
              }) {}

void ScanReceiver::accept(const sensor_msgs::msg::PointCloud2& cloud, const std::stop_token& stop) {
  const auto received = std::chrono::steady_clock::now();
  statistics_.scan_received();
  statistics_.record_scan_header(cloud.header().frame_id(), seconds_since(cloud.header().stamp()));
  auto [from_cloud, cloud_changes] = cloud_reader_.read(cloud);
  auto& [scan, fault, understood] = from_cloud;
  if (!scan) return drop("bad_cloud_" + fault.counter, 1, "bad cloud: " + fault.reason);
  report(cloud_changes, *scan);
  QueuedScan queued{*std::move(scan), cloud.header().frame_id(), received};
  if (delivery_ == DeliveryMode::every) {
    if (!queue_.push_blocking(std::move(queued), stop)) {
      drop("shutdown", 1, "the server is stopping");
    }
    return;
  }
  const std::size_t dropped = queue_.push_dropping_oldest(std::move(queued));
  if (dropped > 0) {
    drop("queue_full", dropped, "scans arrive faster than they can be mapped");
  }
}

void ScanReceiver::report(const std::string& cloud_changes, const Scan& scan) {
  if (!cloud_changes.empty()) spdlog::info("clouds on {}: {}", topic_, cloud_changes);
  const bool due = scans_read_++ % scans_between_checks == 0;
  if (!due && cloud_changes.empty()) return;
  const std::string misfit = sensor_mismatch(scan, sensor_);
  if (misfit.empty()) return;
  statistics_.count("sensor_mismatch");
  throttled_log_.warn("sensor",
                      misfit +
                          ": set 'sensor' in the configuration ('stillmap dataset sensor' "
                          "makes a sensor file from a recording)");
}

void ScanReceiver::drop(const std::string& reason, std::size_t count, const std::string& detail) {
  statistics_.scans_dropped(reason, count, detail);
  throttled_log_.warn(reason, "scan dropped: " + detail);
}

std::string ScanReceiver::no_input_reason() const {
  if (statistics_.received() > 0) return {};
  const dds::ReaderEvents& events = reader_.events();
  std::string text = "no scan received on " + topic_ +
                     " yet: " + std::to_string(events.matched_writers()) +
                     " publishers matched in domain " + std::to_string(domain_id_);
  if (events.incompatible_writers() > 0) {
    text += "; " + std::to_string(events.incompatible_writers()) +
            " publishers do not fit, as they are best-effort and delivery is 'every'";
  }
  return text;
}

}  // namespace stillmap::server
