#pragma once

#include "core/occupancy/occupancy_map.hpp"
#include "server/services/service_context.hpp"
#include "tests/server/latest_map_source.hpp"

namespace stillmap::fuzz {

/// What a server's services answer from, without a server: a small map, its traversability and its
/// octree, a map file in memory.
class ServiceFixture {
 public:
  ServiceFixture();
  ServiceFixture(const ServiceFixture&) = delete;
  ServiceFixture& operator=(const ServiceFixture&) = delete;

  [[nodiscard]] const server::ServiceContext& context() const { return context_; }
  /// As it was at first, whatever requests did to it.
  void reset();

 private:
  void publish_traversability();

  StaticMap map_;
  server::LatestMap latest_map_;
  TileReader tiles_;
  server::Statistics statistics_;
  server::MapSaver saver_;
  test::LatestMapSource source_{latest_map_};
  server::TraversabilitySnapshot snapshot_;
  server::TraversabilityCache traversability_cache_{snapshot_, latest_map_, tiles_};
  TraversabilityConfig traversability_config_;
  server::TraversabilityGridProvider grid_provider_{traversability_config_, "map", latest_map_,
                                                    snapshot_};
  OccupancyMap octree_{OccupancyConfig{}};
  server::ServiceLog log_{statistics_.metrics()};
  server::ServiceContext context_;
};

}  // namespace stillmap::fuzz
