#include "core/traversability/surface_tile.hpp"

#include <algorithm>
#include <cmath>

#include "core/traversability/ground_fill.hpp"

namespace stillmap {
namespace {

static_assert(surface_reach_m > max_filled_gap_m + 1.0, "both ends of a gap need their slopes");

void add_things(SurfaceTile& tile, const GroundCell& ground, Column column) {
  for (const ColumnVoxel& voxel : column) {
    const float above_m = voxel.height_m - ground.height_m;
    if (voxel.height_m > ground.top_m && above_m <= max_object_height_m)
      tile.object_heights_m.push_back(above_m);
  }
}

}  // namespace

SurfaceTile make_surface(const TileNeighbourhood<ColumnTile>& columns, double cell_m) {
  const int margin = std::min(columns.side, static_cast<int>(std::ceil(surface_reach_m / cell_m)));
  const ColumnGrid window = columns.window<Column>(margin, {});
  const GroundLevel level(window, cell_m);
  const int border = std::max(0, margin - shape_reach_cells(cell_m));
  const GroundGrid ground = fill_holes(seen_ground(window, level), window, level, cell_m, border);
  SurfaceTile tile;
  tile.side = columns.side;
  for (int y = margin; y < margin + tile.side; ++y) {
    for (int x = margin; x < margin + tile.side; ++x) {
      SurfaceCell cell;
      cell.ground = ground(x, y);
      if (cell.ground.is_known()) cell.shape = shape_at(ground, x, y, cell_m);
      tile.cells.push_back(cell);
      tile.begin.push_back(static_cast<std::uint32_t>(tile.object_heights_m.size()));
      if (cell.ground.origin != GroundOrigin::none) add_things(tile, cell.ground, window(x, y));
    }
  }
  tile.begin.push_back(static_cast<std::uint32_t>(tile.object_heights_m.size()));
  return tile;
}

}  // namespace stillmap
