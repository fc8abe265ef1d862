#include "server/publishers/server_report.hpp"

#include <unistd.h>

#include <array>
#include <numeric>
#include <utility>

namespace stillmap::server {

namespace {

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

}  // namespace

ServerReport::ServerReport(ServerTraits traits, const LatestMap& latest_map,
                           const Statistics& statistics,
                           std::function<std::vector<dds::Diagnostic>()> discovery_diagnostics,
                           std::function<std::string()> no_input_reason)
    : traits_(std::move(traits)),
      host_(host_name()),
      latest_map_(latest_map),
      statistics_(statistics),
      discovery_diagnostics_(std::move(discovery_diagnostics)),
      no_input_reason_(std::move(no_input_reason)) {}

dds::ServerStatus ServerReport::status() const {
  const auto view = latest_map_.view();
  const std::string live_labels = latest_map_.label_source();
  const auto wall_clock = std::chrono::system_clock::now().time_since_epoch();
  const auto uptime = std::chrono::steady_clock::now() - started_;
  dds::ServerStatus status;
  status.stamp_ns = std::chrono::nanoseconds(wall_clock).count();
  status.software_version = STILLMAP_VERSION;
  status.uptime_s = std::chrono::duration<double>(uptime).count();
  status.delivery = traits_.delivery;
  status.label_source = live_labels.empty() ? traits_.label_source : live_labels;
  status.host = host_;
  status.sensor = traits_.sensor;
  status.points_topic = traits_.points_topic;
  status.health = latest_map_.health();
  status.map_version = view->version;
  status.map_id = view->map_id;
  status.tile_count = view->tiles.size();
  status.voxel_count = std::accumulate(
      view->tiles.begin(), view->tiles.end(), std::uint64_t{0},
      [](std::uint64_t sum, const auto& tile) { return sum + tile->info.voxel_count; });
  statistics_.report_to(status);
  status.diagnostics = discovery_diagnostics_();
  status.diagnostics.insert(status.diagnostics.end(), traits_.host_diagnostics.begin(),
                            traits_.host_diagnostics.end());
  status.reason = reason(status);
  return status;
}

namespace {

/// What segmentation does less than it would on a faster machine; empty when nothing.
std::string reduced_pace(const dds::SegmentationStatus& segmentation) {
  std::string what;
  if (segmentation.interval > 1) {
    what = dds::every_nth_scan(segmentation.interval) + " is segmented, labels are carried between";
  }
  if (segmentation.image_columns > 0 && segmentation.image_columns < segmentation.full_columns) {
    what += (what.empty() ? "" : "; ") + std::string("range images are ") +
            std::to_string(segmentation.image_columns) + " columns wide instead of " +
            std::to_string(segmentation.full_columns);
  }
  return what.empty() ? what : "segmentation cannot keep the sensor's rate: " + what;
}

}  // namespace

std::string ServerReport::reason(const dds::ServerStatus& status) const {
  if (const std::string why = no_input_reason_(); !why.empty()) return why;
  if (const std::string drop = statistics_.last_drop(); !drop.empty()) {
    return "the last scan was dropped: " + drop;
  }
  if (status.health == OdometryHealth::lost) {
    return "the odometry is lost: the last scan does not fit the map";
  }
  if (const std::string failure = statistics_.last_segmentation_failure(); !failure.empty()) {
    return "the last scan could not be segmented: " + failure;
  }
  if (status.received_hz == 0.0) return "no scan for the last seconds";
  if (const std::string pace = reduced_pace(status.segmentation); !pace.empty()) return pace;
  return status.diagnostics.empty() ? std::string() : status.diagnostics.front().what;
}

}  // namespace stillmap::server
