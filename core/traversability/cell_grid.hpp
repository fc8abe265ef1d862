#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace stillmap {

/// A dense grid of cells, row by row from the lowest y.
template <typename T>
class CellGrid {
 public:
  CellGrid() = default;
  CellGrid(int width, int height, const T& value = T{})
      : width_(width),
        height_(height),
        cells_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool contains(int x, int y) const {
    return x >= 0 && y >= 0 && x < width_ && y < height_;
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    assert(contains(x, y));
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  /// @pre contains(x, y)
  [[nodiscard]] T& operator()(int x, int y) { return cells_[index(x, y)]; }
  [[nodiscard]] const T& operator()(int x, int y) const { return cells_[index(x, y)]; }
  [[nodiscard]] std::span<const T> cells() const { return cells_; }

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<T> cells_;
};

/// Calls `visit(x, y)` for every cell in storage order.
template <typename T, typename Visit>
void for_each_cell(const CellGrid<T>& grid, const Visit& visit) {
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) visit(x, y);
  }
}

/// Distance from every cell's centre to that of the nearest marked cell [cells]: exact to float
/// precision up to `max_distance`, which is also the value of all cells farther away. A mark is any
/// value but 0. `each_block` is called before each million cells, and may throw. @pre 0 <
/// max_distance <= 1024
[[nodiscard]] CellGrid<float> distances_to_marked(const CellGrid<std::uint8_t>& marked,
                                                  double max_distance,
                                                  const std::function<void()>& each_block = {});

/// A tile and its eight neighbours; null where there is no tile. `TileT` has `side` columns and
/// rows and `at(x, y)`.
template <typename TileT>
struct TileNeighbourhood {
  /// Row by row from the lowest y; the middle tile is the fifth.
  std::array<const TileT*, 9> tiles{};
  /// Columns along a tile's side.
  int side = 0;

  /// The cell at (x, y) from the middle tile's lowest corner, each in [-side, 2 side); `none` where
  /// there is no tile.
  template <typename T>
  [[nodiscard]] T at(int x, int y, T none) const {
    const int column = (x + side) / side;
    const int row = (y + side) / side;
    const int index = 3 * row + column;
    const TileT* tile = tiles.at(static_cast<std::size_t>(index));
    if (tile == nullptr) return none;
    return T(tile->at(x - (column - 1) * side, y - (row - 1) * side));
  }

  /// The middle tile with a margin on every side. @pre margin <= side
  template <typename T>
  [[nodiscard]] CellGrid<T> window(int margin, T none) const {
    CellGrid<T> cells(side + 2 * margin, side + 2 * margin, none);
    for_each_cell(cells, [&](int x, int y) { cells(x, y) = at<T>(x - margin, y - margin, none); });
    return cells;
  }
};

}  // namespace stillmap
