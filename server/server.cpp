#include "server/server.hpp"

#include <spdlog/spdlog.h>

#include <optional>
#include <utility>

#include "idl/dds/participant.hpp"
#include "idl/interface/topics.hpp"
#include "server/interface.hpp"
#include "server/mapping/map_storage.hpp"
#include "server/mapping/mapping.hpp"
#include "server/monitoring/metrics_endpoint.hpp"
#include "server/monitoring/service_log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/occupancy/occupancy.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/traversability/traversability.hpp"

namespace stillmap::server {
namespace {

dds::DdsOptions server_options(const DdsConfig& config) {
  dds::DdsOptions options = dds_options(config.network, DdsRole::server);
  options.domain_id = config.domain_id;
  options.node_name = config.participant_name;
  options.security = config.security;
  // One client that is not on the network yet must not keep the map from the others.
  options.unresolved_peers_allowed = true;
  return options;
}

ThrottleCallback throttle_callback(const ServerConfig& config, const BackgroundThrottle& throttle,
                                   SaturationPolicy saturation_policy) {
  // When every scan is to be mapped, poses may be late, and background work need not wait.
  if (config.input.delivery == DeliveryMode::every) return {};
  return make_throttle_callback(throttle, saturation_policy);
}

}  // namespace

struct Server::Parts {
  Parts(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
        const OpenSegmenter& open_segmenter);

  // In the order of construction: each part uses those above it, and ends before them.
  Statistics statistics;
  ServiceLog service_log;
  BackgroundThrottle throttle;
  // Before the participant: whoever is seen on DDS has a map file that works.
  MapStorage storage;
  dds::Topics topics;
  dds::Participant participant;
  std::optional<Occupancy> occupancy;
  Mapping mapping;
  Traversability traversability;
  Interface interface;
  std::optional<MetricsEndpoint> metrics;
  ThrottleRelease throttle_release{throttle};
};

Server::Parts::Parts(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
                     const OpenSegmenter& open_segmenter)
    : service_log(statistics.metrics()),
      storage(config, segmenter->name(), statistics),
      topics(dds::Topics::in(config.topics.name_space)),
      participant(server_options(config.dds)),
      // An octree that misses scans is better than late poses.
      occupancy(config.occupancy.enabled
                    ? std::make_optional<Occupancy>(
                          participant, topics, config, statistics,
                          throttle_callback(config, throttle, SaturationPolicy::wait))
                    : std::nullopt),
      mapping(config, std::move(segmenter), open_segmenter,
              {.storage = storage,
               .participant = participant,
               .topics = topics,
               .statistics = statistics,
               .throttle = throttle,
               .occupancy = occupancy ? &occupancy->thread() : nullptr}),
      traversability(config, participant, topics, storage.latest_map(), storage.tiles(), statistics,
                     throttle_callback(config, throttle, SaturationPolicy::run_at_ten_percent)),
      interface(config, {.participant = participant,
                         .topics = topics,
                         .statistics = statistics,
                         .service_log = service_log,
                         .storage = storage,
                         .mapping = mapping,
                         .traversability = traversability,
                         .occupancy = occupancy ? &occupancy->thread() : nullptr}) {
  if (config.metrics.address.empty()) return;
  metrics.emplace(config.metrics.address, statistics.metrics(),
                  [this] { return interface.status(); });
  spdlog::info("metrics: http://{}/metrics", metrics->address());
}

Server::Server(const ServerConfig& config, const OpenSegmenter& open_segmenter)
    // A mount that /tf_static tells is not known yet.
    : parts_(std::make_unique<Parts>(
          config, open_segmenter(config.mapper.sensor, config.mount.T_base_lidar),
          open_segmenter)) {}

Server::~Server() = default;

// Requests and scans wait for the mapping thread: they end first, so that none waits for a thread
// that has ended. The map is saved when nothing can change it any more, and before background
// threads end: where other programs keep all cores busy, those of idle priority may need minutes
// for what they have in work. The topics are closed after that, by the destructors.
void Server::stop() {
  parts_->throttle.release();
  // Where every scan counts, the mapping thread may be waiting for the octree.
  if (parts_->occupancy) parts_->occupancy->thread().release();
  parts_->metrics.reset();
  parts_->interface.stop();
  parts_->mapping.stop();
  parts_->traversability.stop();
}

}  // namespace stillmap::server
