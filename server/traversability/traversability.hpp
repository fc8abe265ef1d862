#pragma once

#include <optional>

#include "config/loaders/server_config.hpp"
#include "core/map/query/tile_reader.hpp"
#include "idl/dds/participant.hpp"
#include "idl/interface/topics.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/traversability/traversability_grid.hpp"
#include "server/traversability/traversability_snapshot.hpp"
#include "server/traversability/traversability_thread.hpp"

namespace stillmap::server {

/// Where the configured robots can go: kept up to date with the map, queried by the services, and
/// published as a grid.
class Traversability {
 public:
  /// Throws what loading the robot profiles throws, and DdsError.
  Traversability(const ServerConfig& config, dds::Participant& participant,
                 const dds::Topics& topics, const LatestMap& latest_map, TileReader& tiles,
                 Statistics& statistics, ThrottleCallback throttle);

  /// Ends the updates; queries are still answered.
  void stop() { thread_.reset(); }

  [[nodiscard]] const TraversabilityCache& views() const { return cache_; }
  [[nodiscard]] const TraversabilityGridProvider& grid() const { return grid_; }

 private:
  TraversabilitySnapshot snapshot_;
  TraversabilityCache cache_;
  TraversabilityGridProvider grid_;
  std::optional<TraversabilityPublisher> publisher_;
  // Last: stops before what it uses is gone.
  std::optional<TraversabilityThread> thread_;
};

}  // namespace stillmap::server
