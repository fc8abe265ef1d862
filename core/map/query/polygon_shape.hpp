#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <utility>
#include <vector>

#include "core/map/query/exact_geometry.hpp"

namespace stillmap {

/// A polygon in plan, asked exactly.
class PolygonShape {
 public:
  /// Corners round the outline, map frame [m]; finite. A repeated corner counts once.
  explicit PolygonShape(const std::vector<Eigen::Vector2d>& corners_map);

  /// Edges i and j (positions in the list of corners given) that share a point and should not;
  /// nothing when the outline is simple.
  [[nodiscard]] std::optional<std::pair<std::size_t, std::size_t>> crossing() const;
  [[nodiscard]] bool has_area() const;

  /// Even-odd; the outline belongs to it.
  [[nodiscard]] bool contains(const Eigen::Vector2d& p_map) const;
  [[nodiscard]] bool intersects(const Eigen::AlignedBox2d& box_map) const;
  [[nodiscard]] bool covers(const Eigen::AlignedBox2d& box_map) const;
  /// Answers `contains` as this does for positions in the box, from fewer edges.
  [[nodiscard]] PolygonShape restricted_to(const Eigen::AlignedBox2d& box_map) const;

 private:
  PolygonShape() = default;
  [[nodiscard]] bool outline_intersects(const Eigen::AlignedBox2d& box_map) const;
  [[nodiscard]] bool may_intersect(std::size_t i, std::size_t j) const;

  std::vector<GridEdge> edges_;
  /// Of each edge, the position of its first corner in the list given.
  std::vector<std::size_t> first_corner_;
};

}  // namespace stillmap
