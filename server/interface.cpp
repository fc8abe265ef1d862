#include "server/interface.hpp"

#include <memory>
#include <string>

namespace stillmap::server {
namespace {

ServerTraits traits(const ServerConfig& config, const InterfaceContext& context) {
  return {.delivery = delivery_mode(config.input.delivery),
          .label_source = context.mapping.label_source(),
          .sensor = config.mapper.sensor.name,
          .points_topic = config.topics.points,
          .host_diagnostics = host_diagnostics(context.participant.options().socket_buffer_bytes)};
}

}  // namespace

Interface::Interface(const ServerConfig& config, const InterfaceContext& context)
    : participant_(context.participant),
      map_publisher_(context.participant, context.topics, config, context.mapping.latest_map()),
      receiver_(std::in_place, context.participant, config, context.mapping.scans(),
                context.statistics),
      discovery_diagnostics_(context.participant),
      report_(
          traits(config, context), context.mapping.latest_map(), context.statistics,
          [this] { return discovery_diagnostics_.diagnostics(); },
          [this] { return receiver_ ? receiver_->no_input_reason() : std::string(); }) {
  const dds::Services names = dds::Services::in(config.topics.name_space);
  const ServiceContext services = service_context(context);
  services_.emplace(context.participant, names, services);
  occupancy_services_.emplace(context.participant, names, services, context.occupancy,
                              config.frames.map);
  Mapping& mapping = context.mapping;
  const RemovedSource removed{
      .removed =
          [&mapping](const Eigen::AlignedBox3d& box_map) { return mapping.removed(box_map); },
      .restore =
          [&mapping](RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
            return mapping.restore_removed(reason, box_map);
          }};
  removed_services_.emplace(context.participant, names, services, removed);
  status_publisher_.emplace(context.participant, context.topics, config.publish.status_period_s,
                            [this] { return status(); });
}

ServiceContext Interface::service_context(const InterfaceContext& context) const {
  Mapping& mapping = context.mapping;
  return {.latest_map = mapping.latest_map(),
          .tiles = mapping.tiles(),
          .saver = mapping.saver(),
          .status = [this] { return status(); },
          .reset = [&mapping] { return mapping.reset(); },
          .load =
              [&mapping](const SavedMap& map, const std::shared_ptr<TileStore>& tile_store) {
                mapping.load(map, tile_store);
              },
          .publish_now = [&mapping] { mapping.publish_now(); },
          .traversability = context.traversability.views(),
          .grid_provider = context.traversability.grid(),
          .log = context.service_log};
}

void Interface::stop() {
  services_.reset();
  occupancy_services_.reset();
  removed_services_.reset();
  status_publisher_.reset();
  receiver_.reset();
}

dds::ServerStatus Interface::status() const {
  dds::ServerStatus status = report_.status();
  for (const auto& [name, value] : participant_.service_faults().counts()) {
    status.counters.push_back({.name = name, .value = value});
  }
  return status;
}

}  // namespace stillmap::server
