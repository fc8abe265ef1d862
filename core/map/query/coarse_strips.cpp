#include "core/map/query/coarse_strips.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

/// A strip takes whole rows of tiles until it has so many.
constexpr std::size_t min_tiles = 4;

}  // namespace

CoarseStrips::CoarseStrips(std::span<const std::shared_ptr<const Tile>> tiles, double resolution_m,
                           double tile_size_m)
    : resolution_m_(resolution_m) {
  // Where a strip ends follows from the ids: rows of tiles are cut at the cell that their far edge
  // lies in.
  std::size_t in_strip = 0;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    ++in_strip;
    const std::int32_t x = tiles[i]->info.id.x;
    const bool ends_row = i + 1 == tiles.size() || tiles[i + 1]->info.id.x != x;
    if (!ends_row || (in_strip < min_tiles && i + 1 < tiles.size())) continue;
    in_strip = 0;
    const double last_cell = std::ceil((x + 1.0) * tile_size_m / resolution_m) - 1.0;
    if (strips_.empty() || last_cell > strips_.back().last_cell) {
      const double first_cell =
          strips_.empty() ? -std::numeric_limits<double>::infinity() : strips_.back().last_cell + 1;
      strips_.push_back({first_cell, last_cell, {}});
    }
  }
  if (strips_.empty()) return;
  // A mean in float may lie just beyond its tile's edge.
  strips_.back().last_cell = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const double first = cell_of(tiles[i]->info.bounds_map.min().x());
    const double last = cell_of(tiles[i]->info.bounds_map.max().x());
    for (auto strip = std::ranges::lower_bound(strips_, first, {}, &Strip::last_cell);
         strip != strips_.end() && strip->first_cell <= last; ++strip) {
      strip->tiles.push_back(i);
    }
  }
}

double CoarseStrips::cell_of(float x_map) const {
  return std::floor(static_cast<double>(x_map) / resolution_m_);
}

}  // namespace stillmap
