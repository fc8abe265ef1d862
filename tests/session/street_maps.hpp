#pragma once

#include <memory>

#include "core/localization/place_index.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/graph/street_world.hpp"

namespace stillmap {

/// A map of a stretch of the street by true poses, in the frame that `T_map_world` leads to.
inline SavedMap street_map(const StreetWorld& world, double from_m, double to_m,
                           const Eigen::Isometry3d& T_map_world, std::uint64_t seed) {
  StaticMap map{StaticMapConfig{}};
  map.reset(seed);
  Trajectory path;
  for (double way = from_m; way < to_m; way += 1.0) {
    const Eigen::Isometry3d T_world_lidar = world.T_map_lidar_at(way, false);
    LabelledScan scan = world.scan_at(T_world_lidar, seed++);
    scan.scan.stamp_ns = static_cast<std::int64_t>(way * 1e9);
    map.insert(scan, T_map_world * T_world_lidar);
    path.push_back({scan.scan.stamp_ns, T_map_world * T_world_lidar});
  }
  SavedMap saved = to_saved_map(map.checkpoint(CheckpointScope::everything));
  saved.trajectory = path;
  return saved;
}

inline std::shared_ptr<const PlaceIndex> index_of(const SavedMap& map) {
  return std::make_shared<const PlaceIndex>(std::make_shared<const MapSnapshot>(map.view),
                                            map.trajectory, std::make_shared<TileReader>());
}

}  // namespace stillmap
