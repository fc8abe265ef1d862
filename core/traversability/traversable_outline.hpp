#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/traversability/occupancy_grid.hpp"

namespace stillmap {

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
