#include "server/interface.hpp"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <utility>

namespace stillmap::server {
namespace {

ServerTraits traits(const ServerConfig& config, const InterfaceContext& context) {
  return {
      .delivery = config.input.delivery,
      .label_source = context.mapping.label_source(),
      .points_topic = config.lidars.empty() ? config.topics.points : config.lidars.front().topic,
      .host_diagnostics = host_diagnostics(context.participant)};
}

/// As many as the network carries before an impatient client asks again: with the default timeout
/// of 5 s that is after 2.5 s.
std::uint32_t max_page_bytes(const dds::DdsOptions& options) {
  constexpr std::uint32_t at_any_rate = 8'000'000;
  constexpr double page_s = 1.5;
  if (options.large_message_bytes_per_s == 0) return at_any_rate;
  return static_cast<std::uint32_t>(
      std::min<double>(at_any_rate, page_s * options.large_message_bytes_per_s));
}

}  // namespace

Interface::Interface(const ServerConfig& config, const InterfaceContext& context)
    : participant_(context.participant),
      map_publisher_(context.participant, context.topics, config, context.storage.latest_map(),
                     context.storage.tiles()),
      discovery_diagnostics_(context.participant, config.topics.name_space),
      report_(
          traits(config, context), context.storage.latest_map(), context.statistics,
          [this] { return diagnostics(); }, [this] { return no_input_reason(); }) {
  start_receivers(config, context);
  services_.emplace(context.participant, config.topics.name_space, service_context(config, context),
                    [this] { return discovery_diagnostics_.namesake_refusal(); });
  status_publisher_.emplace(context.participant, context.topics, config.publish.status_period_s,
                            [this] { return status(); });
}

ServiceContext Interface::service_context(const ServerConfig& config,
                                          const InterfaceContext& context) const {
  Mapping& mapping = context.mapping;
  ServiceContext services{
      .latest_map = context.storage.latest_map(),
      .tiles = context.storage.tiles(),
      .saver = context.storage.saver(),
      .status = [this] { return status(); },
      .begin_map =
          [&mapping](std::uint64_t map_id, const std::shared_ptr<TileStore>& tile_store) {
            mapping.reset(map_id, tile_store);
          },
      .prepare_map =
          [&mapping](const SavedMap& map, const std::shared_ptr<TileStore>& tile_store) {
            return mapping.prepare(map, tile_store);
          },
      .publish_now = [&mapping] { mapping.publish_now(); },
      .removed =
          [&mapping](const Eigen::AlignedBox3d& box_map) { return mapping.removed(box_map); },
      .restore_removed =
          [&mapping](RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
            return mapping.restore_removed(reason, box_map);
          },
      .localize =
          [&mapping](const LocalizationQuestion& question) { return mapping.localize(question); },
      .query_occupancy = {},
      .encode_octomap = {},
      .traversability = context.traversability.views(),
      .grid_provider = context.traversability.grid(),
      .map_frame = config.frames.map,
      .log = context.service_log,
      .max_page_bytes = max_page_bytes(context.participant.options())};
  if (const OccupancyThread* occupancy = context.occupancy) {
    services.query_occupancy = [occupancy](const OccupancyQuery& query) {
      return occupancy->answer(query);
    };
    services.encode_octomap = [occupancy](OctomapEncoding encoding) {
      return occupancy->encode(encoding);
    };
  }
  return services;
}

void Interface::stop() {
  services_.reset();
  status_publisher_.reset();
  // Together: one may hold what another waits for.
  for (ScanReceiver& receiver : receivers_) receiver.request_stop();
  receivers_.clear();
}

void Interface::start_receivers(const ServerConfig& config, const InterfaceContext& context) {
  ScanQueue& scans = context.mapping.scans();
  if (config.lidars.empty()) {
    receivers_.emplace_back(context.participant, config, scans, context.statistics);
    return;
  }
  sweeps_.emplace(config, scans, context.statistics);
  std::set<std::string> topics;
  for (const LidarConfig& lidar : config.lidars) topics.insert(lidar.topic);
  for (const std::string& topic : topics) {
    receivers_.emplace_back(context.participant, config, topic, *sweeps_, scans,
                            context.statistics);
  }
}

std::vector<dds::Diagnostic> Interface::diagnostics() {
  std::vector<dds::Diagnostic> all = discovery_diagnostics_.diagnostics();
  const bool has_input = no_input_reason().empty();
  for (const ScanReceiver& receiver : receivers_) {
    if (const std::string why = receiver.no_input_reason(); has_input && !why.empty()) {
      all.push_back({.severity = dds::Severity::problem,
                     .what = why,
                     .evidence = "another lidar's scans are mapped without this one's",
                     .hint = "start its driver, or correct its topic in 'sensors'"});
    }
    for (dds::Diagnostic& diagnostic : receiver.diagnostics()) {
      all.push_back(std::move(diagnostic));
    }
  }
  return all;
}

std::string Interface::no_input_reason() const {
  std::string first;
  for (const ScanReceiver& receiver : receivers_) {
    const std::string reason = receiver.no_input_reason();
    if (reason.empty()) return {};
    if (first.empty()) first = reason;
  }
  return first;
}

dds::ServerStatus Interface::status() const {
  dds::ServerStatus status = report_.status();
  status.service_faults = participant_.service_faults().counts();
  return status;
}

}  // namespace stillmap::server
