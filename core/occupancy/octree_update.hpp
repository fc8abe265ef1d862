#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <vector>

#include "core/map/tile.hpp"
#include "core/occupancy/scan_update.hpp"

namespace octomap {
class OcTree;
}

namespace stillmap {

/// Increments of a voxel's log-odds for a hit and for a miss.
struct LogOddsSteps {
  float hit = 0.0F;
  float miss = 0.0F;
};

/// Updates all voxels in one traversal of the octree that visits each inner node once. `bricks` are
/// in the octree's order. The result equals that of OctoMap's updateNode() for each voxel.
void update_octree(octomap::OcTree& octree, std::span<const VoxelBrick> bricks,
                   const LogOddsSteps& steps);

/// A square column of the octree over its full height. Its side is that of an inner node, so that
/// no node lies in two columns.
struct OctreeColumn {
  static constexpr std::int32_t side_voxels = 128;
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend auto operator<=>(const OctreeColumn&, const OctreeColumn&) = default;
};

/// The static map's tiles that touch a column.
struct ColumnTiles {
  /// Tiles with their voxels in memory.
  std::vector<std::shared_ptr<const Tile>> resident;
  bool has_non_resident = false;
};

/// The columns that a tile touches.
[[nodiscard]] std::vector<OctreeColumn> columns_of(TileId id, double tile_size_m,
                                                   double resolution_m);
/// The tiles of the view that touch a column.
[[nodiscard]] ColumnTiles tiles_of(OctreeColumn column, const MapSnapshot& view,
                                   double resolution_m);

/// Makes these columns unknown. Copies the rest of the octree.
void evict_columns(octomap::OcTree& octree, const std::set<OctreeColumn>& columns);

}  // namespace stillmap
