#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "core/traversability/cell_grid.hpp"

namespace stillmap {

/// A tile and the eight around it; null where there is none. `TileT` has `side` columns and rows
/// and `at(x, y)`.
template <typename TileT>
struct TileNeighbourhood {
  /// Row after row from the lowest y; the tile itself is the fifth.
  std::array<const TileT*, 9> tiles{};
  /// Columns along a tile's side.
  int side = 0;

  /// What lies at a cell counted from the middle tile's corner, -side to 2 side; `none` where no
  /// tile is.
  template <typename T>
  [[nodiscard]] T at(int x, int y, T none) const {
    const int column = (x + side) / side;
    const int row = (y + side) / side;
    const TileT* tile = tiles.at(static_cast<std::size_t>(3 * row + column));
    if (tile == nullptr) return none;
    return T(tile->at(x - (column - 1) * side, y - (row - 1) * side));
  }

  /// The middle tile with `margin` cells more on every side, margin <= side.
  template <typename T>
  [[nodiscard]] CellGrid<T> window(int margin, T none) const {
    CellGrid<T> cells(side + 2 * margin, side + 2 * margin, none);
    for_each_cell(cells, [&](int x, int y) { cells(x, y) = at<T>(x - margin, y - margin, none); });
    return cells;
  }
};

}  // namespace stillmap
