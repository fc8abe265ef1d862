#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// The tiles of a coarser answer in strips across x, each a whole number of cells wide and of whole
/// rows of tiles: merged one after the other or beside each other, strips give the answer's cells
/// in their order, and none needs more than its own tiles.
class CoarseStrips {
 public:
  /// `tiles` are sorted by id; `resolution_m` is not finer than the map's voxels.
  CoarseStrips(std::span<const std::shared_ptr<const Tile>> tiles, double resolution_m,
               double tile_size_m);

  [[nodiscard]] std::size_t size() const { return strips_.size(); }
  /// Positions in `tiles` of those that reach into the strip.
  [[nodiscard]] const std::vector<std::size_t>& tiles(std::size_t strip) const {
    return strips_[strip].tiles;
  }
  /// Whether the cells of all means with x between these (map frame [m]) lie in the strip.
  [[nodiscard]] bool covers(std::size_t strip, float min_x_map, float max_x_map) const {
    return is_in(strip, min_x_map) && is_in(strip, max_x_map);
  }
  /// Whether the cell of a mean (map frame [m]) lies in the strip.
  [[nodiscard]] bool is_in(std::size_t strip, float x_map) const {
    const double cell = cell_of(x_map);
    return cell >= strips_[strip].first_cell && cell <= strips_[strip].last_cell;
  }

 private:
  /// Cells first_cell .. last_cell in x.
  struct Strip {
    double first_cell = 0.0;
    double last_cell = 0.0;
    std::vector<std::size_t> tiles;
  };
  [[nodiscard]] double cell_of(float x_map) const;

  double resolution_m_;
  std::vector<Strip> strips_;
};

}  // namespace stillmap
