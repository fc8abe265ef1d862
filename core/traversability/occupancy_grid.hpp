#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_region.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// A grid as nav_msgs/OccupancyGrid has it: row after row from the lowest y, -1 unknown, 0 free
/// and wanted, 1..98 free at a cost, 99 too near to something lethal, 100 lethal.
struct OccupancyGrid {
  TraversabilityStatus status = TraversabilityStatus::ok;
  std::string reason;
  /// Lowest corner of the first cell, map frame [m].
  Eigen::Vector2d origin_map = Eigen::Vector2d::Zero();
  double resolution_m = 0.0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::int8_t> data;
  std::uint64_t map_version = 0;

  [[nodiscard]] std::int8_t at(std::uint32_t x, std::uint32_t y) const {
    return data[static_cast<std::size_t>(y) * width + x];
  }
};

inline constexpr std::int8_t occupancy_unknown = -1;
inline constexpr std::int8_t occupancy_inscribed = 99;
inline constexpr std::int8_t occupancy_lethal = 100;

/// Largest grid [cells].
inline constexpr std::uint64_t max_grid_cells = 100'000'000;

/// The cells of a region; those of its box that do not belong to it are unknown. A box that is
/// empty or has NaN is an invalid request, one outside the map is not found, one of more than
/// `max_cells` too large.
[[nodiscard]] OccupancyGrid occupancy_grid(const TraversabilityView& view,
                                           const TraversabilityRegion& region,
                                           std::uint64_t max_cells = max_grid_cells);

/// The view's cells that a grid of it is made of. @pre grid.status is ok
[[nodiscard]] CellRange range_of(const OccupancyGrid& grid);

}  // namespace stillmap
