#pragma once

#include <memory>
#include <optional>

#include "config/loaders/server_config.hpp"
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

/// A running stillmap-server: scans on DDS in; poses, the map and answers out.
class Server {
 public:
  /// Starts everything. Throws DdsError, MapFileError, std::invalid_argument, or what the segmenter
  /// throws.
  Server(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter);

  /// Ends mapping after the scan in work, and saves the map. Throws MapFileError.
  void stop();

 private:
  // In the order of construction: each part uses those above it, and ends before them.
  Statistics statistics_;
  ServiceLog service_log_;
  BackgroundThrottle throttle_;
  // Before the participant: whoever is seen on DDS has a map file that works.
  MapStorage storage_;
  dds::Topics topics_;
  dds::Participant participant_;
  std::optional<Occupancy> occupancy_;
  Mapping mapping_;
  Traversability traversability_;
  Interface interface_;
  std::optional<MetricsEndpoint> metrics_;
  ThrottleRelease throttle_release_{throttle_};
};

}  // namespace stillmap::server
