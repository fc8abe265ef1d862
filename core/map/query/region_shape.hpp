#pragma once

#include <Eigen/Geometry>
#include <variant>

#include "core/map/query/corridor_shape.hpp"
#include "core/map/query/polygon_shape.hpp"
#include "core/map/query/region.hpp"

namespace stillmap {

/// A region made ready for many questions. Map frame [m].
class RegionShape {
 public:
  /// Throws std::invalid_argument with region_faults(region) when there are any.
  explicit RegionShape(const Region& region);

  /// The region is inside; infinite where the region is.
  [[nodiscard]] const Eigen::AlignedBox3d& bounds_map() const { return bounds_map_; }

  /// False for NaN. Exact to a micrometre for polygons, to rounding for the others.
  [[nodiscard]] bool contains(const Eigen::Vector3d& p_map) const;
  /// False only when no position of the box is in the region. The box may be infinitely high.
  [[nodiscard]] bool may_intersect(const Eigen::AlignedBox3d& box_map) const;
  /// True only when the whole box is in the region.
  [[nodiscard]] bool covers(const Eigen::AlignedBox3d& box_map) const;
  /// Answers `contains` as this does for positions in the box, and faster.
  [[nodiscard]] RegionShape restricted_to(const Eigen::AlignedBox3d& box_map) const;

 private:
  struct WholeBounds {};
  using Shape = std::variant<WholeBounds, SphereRegion, PolygonShape, CorridorShape>;
  RegionShape(const Eigen::AlignedBox3d& bounds_map, Shape shape);

  Eigen::AlignedBox3d bounds_map_;
  Shape shape_;
};

}  // namespace stillmap
