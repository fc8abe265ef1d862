#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "core/map/query/plan_shape.hpp"

namespace stillmap {

// Regions of a query. Map frame, metres; boundaries belong to their region.

/// Heights of a region; either end may be infinite.
struct HeightRange {
  double min_m = -std::numeric_limits<double>::infinity();
  double max_m = std::numeric_limits<double>::infinity();
};

/// Axis-aligned; faces may be infinite. By default the whole map.
struct BoxRegion {
  Eigen::AlignedBox3d box_map{Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity()),
                              Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity())};
};

struct SphereRegion {
  Eigen::Vector3d centre_map = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

/// Prism over a simple polygon. Corners go round the outline, in either direction; the first may be
/// repeated at the end.
struct PolygonRegion {
  std::vector<Eigen::Vector2d> corners_map;
  HeightRange heights;
};

/// Everything not farther than `half_width_m` from a path, in plan. The path may cross itself.
struct CorridorRegion {
  std::vector<Eigen::Vector2d> path_map;
  double half_width_m = 0.0;
  HeightRange heights;
};

using Region = std::variant<BoxRegion, SphereRegion, PolygonRegion, CorridorRegion>;

/// Finite coordinates and lengths of a region are at most this: ten times as far as the map goes.
inline constexpr double max_region_coordinate_m = 1e6;
/// Corners of a polygon, points of a path.
inline constexpr std::size_t max_region_points = 4096;

/// Every fault with its field, value and the allowed range; empty when the region can be used.
[[nodiscard]] std::string region_faults(const Region& region);

/// A region prepared for many tests. Map frame [m].
class RegionShape {
 public:
  /// Throws std::invalid_argument with region_faults(region) when there are any.
  explicit RegionShape(const Region& region);

  /// Encloses the region; infinite where the region is.
  [[nodiscard]] const Eigen::AlignedBox3d& bounds_map() const { return bounds_map_; }

  /// False for NaN. Exact to a micrometre for polygons, to rounding for the others.
  [[nodiscard]] bool contains(const Eigen::Vector3d& p_map) const;
  /// The same of a voxel's mean as it is returned. Never inlined, in one source with its caller or
  /// by the linker: in a loop GCC 12 compares the mean before it is rounded, and a box that begins
  /// at a voxel's position misses the voxel.
  [[nodiscard, gnu::noinline]] bool contains_mean(const Eigen::Vector3f& mean_map) const;
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
