#include "core/traversability/column_tile.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {

ColumnTile make_columns(const Tile& tile, int side) {
  const auto is_usable = [side](const Voxel& voxel) {
    return voxel.index.x < side && voxel.index.y < side && std::isfinite(voxel.mean_map.z());
  };
  const auto column_of = [side](const Voxel& voxel) {
    return static_cast<std::size_t>(voxel.index.y) * static_cast<std::size_t>(side) + voxel.index.x;
  };
  ColumnTile columns;
  columns.side = side;
  columns.begin.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side) + 1, 0);
  for (const Voxel& voxel : tile.voxels) {
    if (is_usable(voxel)) ++columns.begin[column_of(voxel) + 1];
  }
  for (std::size_t i = 1; i < columns.begin.size(); ++i) columns.begin[i] += columns.begin[i - 1];
  columns.voxels.resize(columns.begin.back());
  std::vector<std::uint32_t> next(columns.begin.begin(), columns.begin.end() - 1);
  // A tile's voxels are sorted, so those of a column come in ascending order.
  for (const Voxel& voxel : tile.voxels) {
    if (!is_usable(voxel)) continue;
    columns.voxels[next[column_of(voxel)]++] = {voxel.mean_map.z(), voxel.point_count,
                                                voxel.evidence.winner()};
  }
  return columns;
}

}  // namespace stillmap
