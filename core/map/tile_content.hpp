#pragma once

#include <cstdint>
#include <span>

#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Hash of what a client sees of a tile: of every voxel its index, its winning class and its mean
/// to an eighth of a voxel. Counts, evidence and times are not content: they change with every
/// scan and no plan depends on them. Voxels must be sorted by index.
[[nodiscard]] std::uint64_t content_hash(TileId tile, std::span<const Voxel> voxels,
                                         const VoxelGrid& grid);

/// The tile of these voxels, sorted by index, with its hash and bounds.
[[nodiscard]] Tile make_tile(TileId id, std::uint64_t revision, std::vector<Voxel> voxels,
                             const VoxelGrid& grid);

}  // namespace stillmap
