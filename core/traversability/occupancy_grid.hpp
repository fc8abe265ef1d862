#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/map/query/region_shape.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Part of the map from above.
struct TraversabilityRegion {
  /// Map frame [m]; infinite faces end at the map's edge.
  Eigen::AlignedBox2d box_map;
  /// Where given, cells do not belong to it whose centre lies outside of it at every height.
  std::optional<RegionShape> shape;
};

/// The whole map.
[[nodiscard]] TraversabilityRegion whole_map_region();

/// A region from above: its heights do not count, a sphere is its circle. Throws
/// std::invalid_argument with region_faults(region) when there are any.
[[nodiscard]] TraversabilityRegion traversability_region(const Region& region);

/// A rectangle of cells.
struct CellRange {
  CellIndex first;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

/// Calls `visit(i, cell)` for the cells of the range that belong to the region, in any order; i is
/// a cell's place in an array that goes row after row from the lowest y.
void visit_cells(const TraversabilityView& view, const TraversabilityRegion& region,
                 const CellRange& range, const std::function<void(std::size_t, CellIndex)>& visit);

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

/// One closed line; its last corner is joined to the first.
using TraversableRing = std::vector<Eigen::Vector2d>;

/// A piece of free area, map frame [m]: all inside `outer` and outside the holes.
struct TraversablePolygon {
  /// Anticlockwise.
  TraversableRing outer;
  /// Clockwise.
  std::vector<TraversableRing> holes;
};

/// Outlines of what is free in a grid (values 0..98), the largest piece first. Lines run through
/// the centres of the outermost free cells: nothing outside the free area is inside, and a strip
/// one cell wide has no area. Pieces below `min_area_m2` are left out.
[[nodiscard]] std::vector<TraversablePolygon> free_outlines(const OccupancyGrid& grid,
                                                            double min_area_m2 = 1.0);

/// Area of a polygon without its holes [m^2].
[[nodiscard]] double area_m2(const TraversablePolygon& polygon);

}  // namespace stillmap
