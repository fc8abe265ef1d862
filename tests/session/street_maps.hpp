#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/localization/place_index.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/graph/street_world.hpp"

namespace stillmap {

/// A map of scans that were taken at these poses, a second apart; scan k is `scan_at(k)`.
template <typename ScanAt>
SavedMap map_of_scans(const std::vector<Eigen::Isometry3d>& T_map_lidars, const ScanAt& scan_at,
                      std::uint64_t map_id) {
  StaticMap map{StaticMapConfig{}};
  map.reset(map_id);
  Trajectory path;
  for (std::size_t k = 0; k < T_map_lidars.size(); ++k) {
    LabelledScan scan = scan_at(k);
    scan.scan.stamp_ns = static_cast<std::int64_t>(k + 1) * 1'000'000'000;
    map.insert(scan, T_map_lidars[k]);
    path.push_back({scan.scan.stamp_ns, T_map_lidars[k]});
  }
  SavedMap saved = to_saved_map(map.checkpoint(CheckpointScope::everything));
  saved.trajectory = path;
  return saved;
}

/// A map of a stretch of the street by true poses, in the frame that `T_map_world` leads to.
inline SavedMap street_map(const StreetWorld& world, double from_m, double to_m,
                           const Eigen::Isometry3d& T_map_world, std::uint64_t seed) {
  std::vector<Eigen::Isometry3d> T_world_lidars, T_map_lidars;
  for (double way = from_m; way < to_m; way += 1.0) {
    T_world_lidars.push_back(world.T_map_lidar_at(way, false));
    T_map_lidars.push_back(T_map_world * T_world_lidars.back());
  }
  const auto scan_at = [&](std::size_t k) { return world.scan_at(T_world_lidars[k], seed + k); };
  return map_of_scans(T_map_lidars, scan_at, seed);
}

inline std::shared_ptr<const PlaceIndex> index_of(const SavedMap& map) {
  return std::make_shared<const PlaceIndex>(std::make_shared<const MapSnapshot>(map.view),
                                            map.trajectory, std::make_shared<TileReader>());
}

}  // namespace stillmap
