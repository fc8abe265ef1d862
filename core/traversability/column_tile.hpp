#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// A voxel of the map in its column.
struct ColumnVoxel {
  /// Mean height of its points, map frame [m].
  float height_m = 0.0F;
  std::uint32_t points = 0;
  SemanticClass label = SemanticClass::unlabeled;

  friend bool operator==(const ColumnVoxel&, const ColumnVoxel&) = default;
};

using Column = std::span<const ColumnVoxel>;

/// A map tile's voxels sorted by column: the input of all later stages.
struct ColumnTile {
  /// Columns along a side.
  int side = 0;
  /// Index in `voxels` of each column's first voxel, row by row from the lowest y; one more for the
  /// end.
  std::vector<std::uint32_t> begin;
  /// Ascending within each column.
  std::vector<ColumnVoxel> voxels;

  [[nodiscard]] Column at(int x, int y) const {
    const std::size_t column =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(side) + static_cast<std::size_t>(x);
    return Column(voxels).subspan(begin[column], begin[column + 1] - begin[column]);
  }
};

/// Sorts a tile's voxels into columns. Invalid voxels (outside the tile, not finite) are left out.
[[nodiscard]] ColumnTile make_columns(const Tile& tile, int side);

}  // namespace stillmap
