#pragma once

#include <map>
#include <set>

#include "core/map/tile.hpp"
#include "core/traversability/column_tile.hpp"
#include "core/traversability/surface_tile.hpp"

namespace stillmap {

/// A rectangle of a tile's cells, both ends included.
struct CellBox {
  int min_x = 0, min_y = 0, max_x = 0, max_y = 0;
};

/// Where tiles changed.
using ChangedCells = std::map<TileId, CellBox>;

/// The smallest box around the cells in which two states of a tile differ, notes it in `changes`.
/// Null stands for a tile that is not there; a whole tile that comes or goes has changed.
void note_change(ChangedCells& changes, TileId id, const ColumnTile* before,
                 const ColumnTile* after);
void note_change(ChangedCells& changes, TileId id, const SurfaceTile* before,
                 const SurfaceTile* after);

/// The tiles in which or around which (closer than `margin` cells, margin <= side) something
/// changed.
[[nodiscard]] std::set<TileId> affected_tiles(const ChangedCells& changes, int side, int margin);

}  // namespace stillmap
