#pragma once

#include "core/occupancy/occupancy_map.hpp"
#include "server/services/get_static_map.hpp"
#include "server/services/removed_voxels.hpp"
#include "server/services/service_context.hpp"

namespace stillmap::fuzz {

/// What a server's services answer from, without a server: a small map, its areas, a map file in
/// memory.
class ServedWorld {
 public:
  ServedWorld();
  ServedWorld(const ServedWorld&) = delete;
  ServedWorld& operator=(const ServedWorld&) = delete;

  [[nodiscard]] const ServiceContext& context() const { return context_; }
  [[nodiscard]] const RemovedSource& removed() const { return removed_; }
  [[nodiscard]] GetStaticMap& static_map() { return static_map_; }
  [[nodiscard]] const OccupancyMap& octree() const { return octree_; }
  /// As it was at first, whatever requests did to it.
  void begin_again();

 private:
  void show_areas();

  StaticMap map_;
  MapBoard board_;
  TileReader tiles_;
  MapSaver saver_;
  AreaBoard areas_;
  AreaAtlas atlas_{areas_, board_, tiles_};
  AreasConfig areas_config_;
  PlanningGrid grid_{areas_config_, "map", board_, areas_};
  OccupancyMap octree_{OccupancyConfig{}};
  RemovedSource removed_;
  ServiceLog log_;
  ServiceContext context_;
  GetStaticMap static_map_{context_};
};

}  // namespace stillmap::fuzz
