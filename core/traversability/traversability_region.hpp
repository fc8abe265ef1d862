#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>

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

}  // namespace stillmap
