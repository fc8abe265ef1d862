#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "core/map/query/tile_reader.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/traversability/traversability_snapshot.hpp"

namespace stillmap::server {

/// The areas of any part of the map: those that are kept up to date in the background and, where
/// tiles of the map are not in memory, ones that are worked out for who asks. Thread-safe.
class TraversabilityCache {
 public:
  TraversabilityCache(const TraversabilitySnapshot& snapshot, const LatestMap& latest_map,
                      TileReader& tiles);

  /// An area that is complete within the box (map frame [m]). Throws std::invalid_argument for a
  /// robot that is not kept, naming those that are, and for a box with more tiles out of memory
  /// than one answer may bring back; and as TileReader::whole.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, const Eigen::AlignedBox2d& box_map) const;

 private:
  const TraversabilitySnapshot& snapshot_;
  const LatestMap& latest_map_;
  TileReader& tiles_;
};

}  // namespace stillmap::server
