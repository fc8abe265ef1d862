#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// Positions in `view.tiles`, ascending, of the tiles whose bounds meet the box (map frame [m],
/// faces included, infinite faces allowed). Empty for a box with NaN or min > max.
[[nodiscard]] std::vector<std::size_t> tiles_in_box(const MapView& view,
                                                    const Eigen::AlignedBox3d& box_map);

/// What a client compares with its own copies: the infos of the tiles that meet the box.
[[nodiscard]] std::vector<TileInfo> tile_versions(const MapView& view,
                                                  const Eigen::AlignedBox3d& box_map);

/// The tiles of these ids, in their order; ids that the view does not have are left out.
[[nodiscard]] std::vector<std::shared_ptr<const Tile>> find_tiles(const MapView& view,
                                                                  std::span<const TileId> ids);

}  // namespace stillmap
