#pragma once

#include <cstdint>
#include <limits>

#include "core/traversability/cell_grid.hpp"

namespace stillmap {

/// Squared distance of a cell when nothing is marked.
inline constexpr std::int32_t no_distance = std::numeric_limits<std::int32_t>::max();

/// Squared distance, in cells, from every cell's centre to the nearest marked cell's (exact;
/// A. Meijster, J. Roerdink, W. Hesselink, "A general algorithm for computing distance transforms
/// in linear time", 2000). A mark is any value but 0. Sides of up to 30,000 cells.
[[nodiscard]] CellGrid<std::int32_t> squared_distances(const CellGrid<std::uint8_t>& marked);

}  // namespace stillmap
