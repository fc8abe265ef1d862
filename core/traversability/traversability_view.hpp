#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/traversability/traversability_tile.hpp"

namespace stillmap {

/// A cell of the whole map: [x, x+1) * cell_m by [y, y+1) * cell_m in the map frame.
struct CellIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const CellIndex&, const CellIndex&) = default;
};

/// An immutable state of the area that one robot can drive on; safe to read from any thread.
struct TraversabilityView {
  /// Of the map that it was made from.
  std::uint64_t version = 0;
  std::uint64_t map_id = 0;
  double tile_size_m = 0.0;
  /// Edge of a cell: the map's voxel size [m].
  double cell_m = 0.0;
  RobotProfile profile;
  /// Sorted by id; a tile for every tile of the map.
  std::vector<std::shared_ptr<const TraversabilityTile>> tiles;

  /// The cell that holds a place (map frame [m]); nothing for one that is not finite or farther
  /// than 100 km from the origin.
  [[nodiscard]] std::optional<CellIndex> cell_of(const Eigen::Vector2d& position_map) const;
  /// Its centre, map frame [m].
  [[nodiscard]] Eigen::Vector2d centre_of(CellIndex cell) const;
  /// Box around all tiles, map frame [m]; empty without tiles.
  [[nodiscard]] Eigen::AlignedBox2d bounds_map() const;
};

/// Looks up cells of a view, quickest when one lies near the last; must not outlive the view.
class CellLookup {
 public:
  explicit CellLookup(const TraversabilityView& view);

  struct Found {
    TraversabilityCell cell;
    /// Null where there is no tile.
    const SurfaceCell* surface = nullptr;
  };
  /// A cell where there is no tile is unknown.
  [[nodiscard]] Found at(CellIndex cell);

 private:
  const TraversabilityView& view_;
  std::int32_t side_;
  std::optional<TileId> last_id_;
  const TraversabilityTile* last_ = nullptr;
};

}  // namespace stillmap
