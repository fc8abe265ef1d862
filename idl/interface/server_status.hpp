#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/lidar/delivery_mode.hpp"
#include "core/odometry/odometry_state.hpp"
#include "idl/dds/service_faults.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap::dds {

/// An event of the server's life and how often it happened, as "scans_mapped".
struct NamedCounter {
  std::string name;
  /// Which one, where a name has several: of "scans_dropped" the reason, of a service's fault the
  /// service. Else empty.
  std::string detail{};
  std::uint64_t value = 0;
};

/// Of scans that were received and not mapped, a counter for every reason that occurred.
inline constexpr const char* scans_dropped_counter = "scans_dropped";

/// Of clouds that could not be read as scans, a counter for every fault that occurred: "no_xyz".
/// They are among the scans dropped.
inline constexpr const char* bad_clouds_counter = "bad_clouds";
/// What bad_clouds_counter counts of bytes that are no cloud at all.
inline constexpr const char* unreadable_cloud = "unreadable";

/// Of checkpoints that failed since the last one that did not: while it is above 0, what is mapped
/// is in memory alone.
inline constexpr const char* checkpoints_failing_counter = "checkpoints_failing";

/// How segmentation keeps up with the scans.
struct SegmentationStatus {
  /// Every `interval`-th scan is segmented; those between get labels from the map and the last
  /// labelled scan.
  std::uint32_t interval = 1;
  /// Median time of the label source over the last scans; 0 before the first.
  double inference_ms = 0.0;
  /// Columns of the range images that are segmented, and how many they are on a machine that is
  /// fast enough; 0: no range images.
  std::uint32_t image_columns = 0;
  std::uint32_t full_columns = 0;
  /// Shares of the last scans: with labels of their own, with propagated labels, with none.
  double fresh_share = 0.0;
  double propagated_share = 0.0;
  double unlabelled_share = 0.0;
};

/// "every scan", "every 2nd scan", "every 13th scan"; n >= 1.
[[nodiscard]] std::string every_nth_scan(std::uint32_t n);

/// How long a stage of the pipeline took over the last scans.
struct StageLatency {
  std::string stage;
  double p50_ms = 0.0;
  double p99_ms = 0.0;
  double max_ms = 0.0;
  /// Scans that the figures stand for.
  std::uint32_t samples = 0;
};

/// State of a running server.
struct ServerStatus {
  /// The server's clock, nanoseconds since the Unix epoch.
  std::int64_t stamp_ns = 0;
  std::string software_version;
  double uptime_s = 0.0;
  DeliveryMode delivery = DeliveryMode::latest;
  /// "stream", "none", or the model's name.
  std::string label_source;
  /// Of the last mapped scan.
  OdometryHealth health = OdometryHealth::initialised;
  /// Why nothing happens, or what goes wrong, in words; empty when all is well.
  std::string reason;
  /// Scans a second over the last seconds, received and mapped.
  double received_hz = 0.0;
  double mapped_hz = 0.0;
  std::uint64_t map_version = 0;
  std::uint64_t map_id = 0;
  std::uint64_t tile_count = 0;
  std::uint64_t voxel_count = 0;
  SegmentationStatus segmentation;
  /// "scans_received", "scans_mapped", "scans_lost" (which did not arrive) and "label_failures"
  /// once there are any, scans_dropped_counter and bad_clouds_counter; then events beside mapping,
  /// as "occupancy_not_cleared". As read from the wire, `service_faults`, too.
  std::vector<NamedCounter> counters;
  /// Of this process. On the wire they are counters of the fault's name, the service their detail.
  std::vector<ServiceFault> service_faults{};
  /// In the order of the pipeline: wait in the queue, its stages, and "total"; then
  /// what runs beside it, as "occupancy".
  std::vector<StageLatency> latencies;
  /// Name of the server's machine.
  std::string host;
  /// The sensor that the server is set up for.
  std::string sensor;
  /// ROS 2 name of the topic that scans are read from.
  std::string points_topic;
  /// Frame that the last cloud named; empty before the first.
  std::string scan_frame;
  /// The server's clock when the last cloud arrived, minus the cloud's stamp; years for a
  /// bag.
  double scan_delay_s = 0.0;
  /// What is wrong with other participants of the domain and the server's machine.
  std::vector<Diagnostic> diagnostics;

  /// Value of a counter; 0 when it never counted.
  [[nodiscard]] std::uint64_t counter(std::string_view name, std::string_view detail = {}) const;
  /// Scans dropped, for all reasons.
  [[nodiscard]] std::uint64_t dropped() const;
  /// Scans dropped for this reason, as "queue_full".
  [[nodiscard]] std::uint64_t dropped(std::string_view reason) const;
};

}  // namespace stillmap::dds
