#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/map/query/region.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Part of the map in plan view.
struct TraversabilityRegion {
  /// Map frame [m]; infinite bounds end at the map's edge.
  Eigen::AlignedBox2d box_map;
  /// If set, the region has only cells whose centre lies in the shape at some height.
  std::optional<RegionShape> shape;
};

[[nodiscard]] TraversabilityRegion whole_map_region();

/// Plan view of a region: heights are ignored, a sphere becomes a circle. Throws
/// std::invalid_argument with region_faults(region) if there are any.
[[nodiscard]] TraversabilityRegion traversability_region(const Region& region);

/// A rectangle of cells.
struct CellRange {
  CellIndex first;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

/// Calls `visit(i, cell)` for the cells of the range that belong to the region, in any order; i is
/// the cell's index in an array that stores the range row by row from the lowest y.
void visit_cells(const TraversabilityView& view, const TraversabilityRegion& region,
                 const CellRange& range, const std::function<void(std::size_t, CellIndex)>& visit);

/// A grid as in nav_msgs/OccupancyGrid: row by row from the lowest y, -1 unknown, 0..98 cost of
/// free cells, 99 inscribed, 100 lethal.
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

/// The cells of a region; cells of its box outside the region are unknown. A box that is empty or
/// has NaN is an invalid request, one outside the map is not found, one of more than `max_cells`
/// too large.
[[nodiscard]] OccupancyGrid occupancy_grid(const TraversabilityView& view,
                                           const TraversabilityRegion& region,
                                           std::uint64_t max_cells = max_grid_cells);

/// The range of the view's cells that a grid covers. @pre grid.status is ok
[[nodiscard]] CellRange range_of(const OccupancyGrid& grid);

/// A closed line; the last corner is joined to the first.
using TraversableRing = std::vector<Eigen::Vector2d>;

/// A connected free area, map frame [m]: the inside of `outer` without the holes.
struct TraversablePolygon {
  /// Counterclockwise.
  TraversableRing outer;
  /// Clockwise.
  std::vector<TraversableRing> holes;
};

/// Outlines of the free areas of a grid (values 0..98), the largest first. Lines run through the
/// centres of the outermost free cells, so that they enclose free cells only; a strip one cell wide
/// has no area. Areas below `min_area_m2` are left out.
[[nodiscard]] std::vector<TraversablePolygon> free_outlines(const OccupancyGrid& grid,
                                                            double min_area_m2 = 1.0);

/// Area of a polygon, less its holes [m^2].
[[nodiscard]] double area_m2(const TraversablePolygon& polygon);

}  // namespace stillmap
