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

/// What a hit and a miss add to a voxel's log-odds.
struct LogOddsSteps {
  float hit = 0.0F;
  float miss = 0.0F;
};

/// Updates all these voxels in one walk through the octree: an inner node is visited once, however
/// many voxels below it change. `bricks` are in the octree's order. The result is what OctoMap's
/// updateNode() makes of the voxels one by one.
void update_octree(octomap::OcTree& octree, std::span<const VoxelBrick> bricks,
                   const LogOddsSteps& steps);

/// A square column of the octree, of all heights: so many voxels to a side that it is a whole
/// number of the octree's inner nodes.
struct OctreeColumn {
  static constexpr std::int32_t side_voxels = 128;
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend auto operator<=>(const OctreeColumn&, const OctreeColumn&) = default;
};

/// What the static map has of a column.
struct ColumnTiles {
  /// Those in memory.
  std::vector<std::shared_ptr<const Tile>> resident;
  bool has_nonresident = false;
};

/// The columns that tiles of the view touch.
[[nodiscard]] std::map<OctreeColumn, ColumnTiles> columns_of(const MapSnapshot& view,
                                                             double resolution_m);

/// Makes all of these columns unknown, at the cost of a copy of what is left.
void evict_columns(octomap::OcTree& octree, const std::set<OctreeColumn>& columns);

}  // namespace stillmap
