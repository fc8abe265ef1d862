#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// The column of a tile, all heights, and a little round it: a mean in float may lie just outside.
[[nodiscard]] Eigen::AlignedBox3d tile_footprint(TileId id, double tile_size_m);

/// Ids first.x .. last.x by first.y .. last.y.
struct TileRange {
  TileId first;
  TileId last;
};
/// The tiles whose footprint meets the box (map frame [m]; faces may be infinite, NaN must not be).
[[nodiscard]] TileRange tile_range(const Eigen::AlignedBox3d& box_map, double tile_size_m);

/// Positions in `view.tiles`, ascending, of the tiles whose bounds meet the box (map frame [m],
/// faces included, infinite faces allowed). Empty for a box with NaN or min > max.
[[nodiscard]] std::vector<std::size_t> tiles_in_box(const MapSnapshot& view,
                                                    const Eigen::AlignedBox3d& box_map);

/// What a client compares with its own copies: the infos of the tiles that meet the box.
[[nodiscard]] std::vector<TileInfo> tile_versions(const MapSnapshot& view,
                                                  const Eigen::AlignedBox3d& box_map);

/// The tiles of these ids, in their order; ids that the view does not have are left out.
[[nodiscard]] std::vector<std::shared_ptr<const Tile>> find_tiles(const MapSnapshot& view,
                                                                  std::span<const TileId> ids);

}  // namespace stillmap
