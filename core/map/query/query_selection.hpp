#pragma once

#include <cstddef>
#include <vector>

#include "core/map/query/map_query.hpp"
#include "core/map/query/region_shape.hpp"
#include "core/map/query/tile_reader.hpp"

namespace stillmap {

/// Which voxels of a tile are asked for.
class VoxelFilter {
 public:
  /// The tile may be non-resident: its info tells whether all of it is taken.
  VoxelFilter(const MapQuery& query, const RegionShape& region, const Tile& tile);

  [[nodiscard]] bool matches_all() const { return is_inside_ && matches_all_classes_; }
  [[nodiscard]] bool matches(const Voxel& voxel) const {
    return (is_inside_ || near_.contains(voxel.mean_map.cast<double>())) &&
           (matches_all_classes_ ||
            query_.classes.test(static_cast<std::size_t>(voxel.evidence.winner())));
  }
  /// How many of the tile's voxels it matches.
  [[nodiscard]] std::uint32_t count(const Tile& tile) const;

 private:
  const MapQuery& query_;
  bool is_inside_;
  bool matches_all_classes_;
  RegionShape near_;
};

/// Positions in `view.tiles`, ascending, of the tiles that an answer is made from: those with
/// voxels near the region; with `since`, those that changed and stand on it, even if no voxel
/// there is left.
[[nodiscard]] std::vector<std::size_t> selected_tiles(const MapSnapshot& view,
                                                      const MapQuery& query,
                                                      const RegionShape& region);

/// What an answer says of its tiles; `selected` as selected_tiles gives it.
[[nodiscard]] std::vector<TileChange> tile_changes(const MapSnapshot& view, const MapQuery& query,
                                                   const RegionShape& region,
                                                   const std::vector<std::size_t>& selected,
                                                   const TileHistory* history, TileReader& reader);

}  // namespace stillmap
