#include "idl/conversions/status.hpp"

#include "idl/conversions/header.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::wire {
namespace {

namespace status_codes = stillmap_msgs::msg::Status_Constants;
static_assert(static_cast<std::uint8_t>(DeliveryMode::latest) == status_codes::DELIVERY_LATEST &&
              static_cast<std::uint8_t>(DeliveryMode::every) == status_codes::DELIVERY_EVERY);
static_assert(static_cast<std::uint8_t>(OdometryHealth::initialised) ==
                  status_codes::HEALTH_INITIALISED &&
              static_cast<std::uint8_t>(OdometryHealth::good) == status_codes::HEALTH_GOOD &&
              static_cast<std::uint8_t>(OdometryHealth::degenerate) ==
                  status_codes::HEALTH_DEGENERATE &&
              static_cast<std::uint8_t>(OdometryHealth::lost) == status_codes::HEALTH_LOST);
namespace severities = stillmap_msgs::msg::Diagnostic_Constants;
static_assert(static_cast<std::uint8_t>(dds::Severity::advice) == severities::WARN &&
              static_cast<std::uint8_t>(dds::Severity::problem) == severities::ERROR);

void add_lists(const dds::ServerStatus& status, stillmap_msgs::msg::Status& message) {
  for (const dds::ServiceFault& fault : status.service_faults) {
    auto& out = message.counters().emplace_back();
    out.name(fault.fault);
    out.detail(fault.service);
    out.value(fault.count);
  }
  for (const dds::NamedCounter& counter : status.counters) {
    auto& out = message.counters().emplace_back();
    out.name(counter.name);
    out.detail(counter.detail);
    out.value(counter.value);
  }
  for (const dds::StageLatency& latency : status.latencies) {
    auto& out = message.latencies().emplace_back();
    out.stage(latency.stage);
    out.p50_ms(latency.p50_ms);
    out.p99_ms(latency.p99_ms);
    out.max_ms(latency.max_ms);
    out.samples(latency.samples);
  }
}

void add_diagnostics(const dds::ServerStatus& status, stillmap_msgs::msg::Status& message) {
  for (const dds::Diagnostic& diagnostic : status.diagnostics) {
    auto& out = message.diagnostics().emplace_back();
    out.severity(static_cast<std::uint8_t>(diagnostic.severity));
    out.what(diagnostic.what);
    out.evidence(diagnostic.evidence);
    out.hint(diagnostic.hint);
  }
}

void add_diagnostics(const stillmap_msgs::msg::Status& message, dds::ServerStatus& status) {
  for (const auto& diagnostic : message.diagnostics()) {
    const bool is_advice = diagnostic.severity() == severities::WARN;
    status.diagnostics.push_back(
        {.severity = is_advice ? dds::Severity::advice : dds::Severity::problem,
         .what = diagnostic.what(),
         .evidence = diagnostic.evidence(),
         .hint = diagnostic.hint()});
  }
}

void add_lists(const stillmap_msgs::msg::Status& message, dds::ServerStatus& status) {
  for (const auto& counter : message.counters()) {
    status.counters.push_back(
        {.name = counter.name(), .detail = counter.detail(), .value = counter.value()});
  }
  for (const auto& latency : message.latencies()) {
    status.latencies.push_back({.stage = latency.stage(),
                                .p50_ms = latency.p50_ms(),
                                .p99_ms = latency.p99_ms(),
                                .max_ms = latency.max_ms(),
                                .samples = latency.samples()});
  }
}

void to_wire(const dds::SegmentationStatus& status,
             stillmap_msgs::msg::SegmentationStatus& message) {
  message.interval(status.interval);
  message.inference_ms(status.inference_ms);
  message.image_columns(status.image_columns);
  message.full_columns(status.full_columns);
  message.fresh_share(status.fresh_share);
  message.propagated_share(status.propagated_share);
  message.unlabelled_share(status.unlabelled_share);
}

dds::SegmentationStatus from_wire(const stillmap_msgs::msg::SegmentationStatus& message) {
  return {.interval = message.interval(),
          .inference_ms = message.inference_ms(),
          .image_columns = message.image_columns(),
          .full_columns = message.full_columns(),
          .fresh_share = message.fresh_share(),
          .propagated_share = message.propagated_share(),
          .unlabelled_share = message.unlabelled_share()};
}

}  // namespace

stillmap_msgs::msg::Status to_wire(const dds::ServerStatus& status) {
  stillmap_msgs::msg::Status message;
  message.format_version(dds::wire_format_version);
  message.stamp(to_stamp(status.stamp_ns));
  message.software_version(status.software_version);
  message.uptime_s(status.uptime_s);
  message.delivery(static_cast<std::uint8_t>(status.delivery));
  message.label_source(status.label_source);
  message.health(static_cast<std::uint8_t>(status.health));
  message.reason(status.reason);
  message.received_hz(status.received_hz);
  message.mapped_hz(status.mapped_hz);
  message.map_version(status.map_version);
  message.map_id(status.map_id);
  message.tile_count(status.tile_count);
  message.voxel_count(status.voxel_count);
  to_wire(status.segmentation, message.segmentation());
  message.host(status.host);
  message.sensor(status.sensor);
  message.points_topic(status.points_topic);
  message.scan_frame(status.scan_frame);
  message.scan_delay_s(status.scan_delay_s);
  add_lists(status, message);
  add_diagnostics(status, message);
  return message;
}

std::optional<dds::ServerStatus> from_wire(const stillmap_msgs::msg::Status& message) {
  const auto stamp = stamp_ns(message.stamp());
  if (message.format_version() != dds::wire_format_version || !stamp ||
      message.delivery() > status_codes::DELIVERY_EVERY ||
      message.health() > status_codes::HEALTH_LOST) {
    return std::nullopt;
  }
  dds::ServerStatus status{.stamp_ns = *stamp,
                           .software_version = message.software_version(),
                           .uptime_s = message.uptime_s(),
                           .delivery = static_cast<DeliveryMode>(message.delivery()),
                           .label_source = message.label_source(),
                           .health = static_cast<OdometryHealth>(message.health()),
                           .reason = message.reason(),
                           .received_hz = message.received_hz(),
                           .mapped_hz = message.mapped_hz(),
                           .map_version = message.map_version(),
                           .map_id = message.map_id(),
                           .tile_count = message.tile_count(),
                           .voxel_count = message.voxel_count(),
                           .segmentation = from_wire(message.segmentation()),
                           .counters = {},
                           .latencies = {},
                           .host = message.host(),
                           .sensor = message.sensor(),
                           .points_topic = message.points_topic(),
                           .scan_frame = message.scan_frame(),
                           .scan_delay_s = message.scan_delay_s(),
                           .diagnostics = {}};
  add_lists(message, status);
  add_diagnostics(message, status);
  return status;
}

}  // namespace stillmap::wire
