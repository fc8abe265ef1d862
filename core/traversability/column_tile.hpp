#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// A voxel of the map as one column of cells sees it.
struct ColumnVoxel {
  /// Mean height of its points, map frame [m].
  float height_m = 0.0F;
  std::uint32_t points = 0;
  SemanticClass label = SemanticClass::unlabeled;

  friend bool operator==(const ColumnVoxel&, const ColumnVoxel&) = default;
};

using Column = std::span<const ColumnVoxel>;

/// A map tile's voxels, column by column: what all later stages read.
struct ColumnTile {
  /// Columns along a side.
  int side = 0;
  /// Of every column (row after row from the lowest y), where it begins in `voxels`; one more for
  /// the end.
  std::vector<std::uint32_t> begin;
  /// Of every column from the lowest up.
  std::vector<ColumnVoxel> voxels;

  [[nodiscard]] Column at(int x, int y) const {
    const std::size_t column =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(side) + static_cast<std::size_t>(x);
    return Column(voxels).subspan(begin[column], begin[column + 1] - begin[column]);
  }
  friend bool operator==(const ColumnTile&, const ColumnTile&) = default;
};

/// Sorts a tile's voxels into columns. Voxels whose place or mean cannot be (outside the tile, not
/// finite) are left out.
[[nodiscard]] ColumnTile make_columns(const Tile& tile, int side);

}  // namespace stillmap
