#include "server/publishers/server_report.hpp"

#include <unistd.h>

#include <array>
#include <numeric>
#include <utility>

namespace stillmap {

namespace {

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

}  // namespace

ServerReport::ServerReport(ServerTraits traits, const MapBoard& board, const Statistics& statistics,
                           std::function<std::vector<Finding>()> peer_findings,
                           std::function<std::string()> why_nothing_arrives)
    : traits_(std::move(traits)),
      host_(host_name()),
      board_(board),
      statistics_(statistics),
      peer_findings_(std::move(peer_findings)),
      why_nothing_arrives_(std::move(why_nothing_arrives)) {}

ServerStatus ServerReport::status() const {
  const auto view = board_.view();
  const std::string live_labels = board_.label_source();
  const auto wall_clock = std::chrono::system_clock::now().time_since_epoch();
  const auto uptime = std::chrono::steady_clock::now() - started_;
  ServerStatus status;
  status.stamp_ns = std::chrono::nanoseconds(wall_clock).count();
  status.software_version = STILLMAP_VERSION;
  status.uptime_s = std::chrono::duration<double>(uptime).count();
  status.delivery = traits_.delivery;
  status.label_source = live_labels.empty() ? traits_.label_source : live_labels;
  status.host = host_;
  status.sensor = traits_.sensor;
  status.points_topic = traits_.points_topic;
  status.health = board_.health();
  status.map_version = view->version;
  status.map_id = view->map_id;
  status.tile_count = view->tiles.size();
  status.voxel_count = std::accumulate(
      view->tiles.begin(), view->tiles.end(), std::uint64_t{0},
      [](std::uint64_t sum, const auto& tile) { return sum + tile->info.voxel_count; });
  statistics_.report_to(status);
  status.findings = peer_findings_();
  status.findings.insert(status.findings.end(), traits_.troubles.begin(), traits_.troubles.end());
  status.reason = reason(status);
  return status;
}

namespace {

/// What segmentation does less than it would on a faster machine; empty when nothing.
std::string reduced_pace(const SegmentationStatus& segmentation) {
  std::string what;
  if (segmentation.every > 1) {
    what = every_nth_scan(segmentation.every) + " is segmented, labels are carried between";
  }
  if (segmentation.image_columns > 0 && segmentation.image_columns < segmentation.full_columns) {
    what += (what.empty() ? "" : "; ") + std::string("range images are ") +
            std::to_string(segmentation.image_columns) + " columns wide instead of " +
            std::to_string(segmentation.full_columns);
  }
  return what.empty() ? what : "segmentation cannot keep the sensor's rate: " + what;
}

}  // namespace

std::string ServerReport::reason(const ServerStatus& status) const {
  if (const std::string why = why_nothing_arrives_(); !why.empty()) return why;
  if (const std::string drop = statistics_.last_drop(); !drop.empty()) {
    return "the last scan was dropped: " + drop;
  }
  if (status.health == OdometryHealth::lost) {
    return "the odometry is lost: the last scan does not fit the map";
  }
  if (const std::string failure = statistics_.last_label_failure(); !failure.empty()) {
    return "the last scan could not be segmented: " + failure;
  }
  if (status.received_hz == 0.0) return "no scan for the last seconds";
  if (const std::string pace = reduced_pace(status.segmentation); !pace.empty()) return pace;
  return status.findings.empty() ? std::string() : status.findings.front().what;
}

}  // namespace stillmap
