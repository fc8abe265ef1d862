#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "core/map/query/tile_reader.hpp"
#include "server/traversability/traversability_snapshot.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap {

/// The areas of any part of the map: those that are kept up to date in the background and, where
/// tiles of the map are not in memory, ones that are worked out for who asks. Thread-safe.
class AreaAtlas {
 public:
  AreaAtlas(const AreaBoard& areas, const MapBoard& maps, TileReader& tiles);

  /// An area that is complete within the box (map frame [m]). Throws std::invalid_argument for a
  /// robot that is not kept, naming those that are, and for a box with more tiles out of memory
  /// than one answer may bring back; and as TileReader::whole.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, const Eigen::AlignedBox2d& box_map) const;

 private:
  const AreaBoard& areas_;
  const MapBoard& maps_;
  TileReader& tiles_;
};

}  // namespace stillmap
