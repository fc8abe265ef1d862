#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace stillmap {

/// A position in plan in steps of 2^-20 m, about a micrometre: on whole numbers, which side of a
/// line a point lies on has an exact answer, at 100 km from the origin as at 1 m.
struct GridPoint {
  std::int64_t x = 0;
  std::int64_t y = 0;
  friend bool operator==(const GridPoint&, const GridPoint&) = default;
};

/// A straight edge on the grid.
struct GridEdge {
  GridPoint a;
  GridPoint b;

  [[nodiscard]] std::int64_t min_x() const { return std::min(a.x, b.x); }
  [[nodiscard]] std::int64_t max_x() const { return std::max(a.x, b.x); }
  [[nodiscard]] std::int64_t min_y() const { return std::min(a.y, b.y); }
  [[nodiscard]] std::int64_t max_y() const { return std::max(a.y, b.y); }
};

/// A polygon in plan. Its predicates are exact on the grid of GridPoint.
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

/// Everything in plan within a distance of a path; ends and bends are round.
class CorridorShape {
 public:
  /// At least two points, finite, map frame [m].
  CorridorShape(const std::vector<Eigen::Vector2d>& path_map, double half_width_m);

  [[nodiscard]] Eigen::AlignedBox2d bounds_map() const;
  [[nodiscard]] bool contains(const Eigen::Vector2d& p_map) const;
  [[nodiscard]] bool intersects(const Eigen::AlignedBox2d& box_map) const;
  /// True only if one piece of the path is near all of the box.
  [[nodiscard]] bool covers(const Eigen::AlignedBox2d& box_map) const;
  /// Answers `contains` as this does for positions in the box, from fewer pieces.
  [[nodiscard]] CorridorShape restricted_to(const Eigen::AlignedBox2d& box_map) const;

 private:
  struct Piece {
    Eigen::Vector2d begin_map;
    Eigen::Vector2d end_map;
  };
  explicit CorridorShape(double half_width_m) : half_width_m_(half_width_m) {}
  [[nodiscard]] bool is_near(const Piece& piece, const Eigen::Vector2d& p_map) const;
  [[nodiscard]] bool intersects(const Piece& piece, const Eigen::AlignedBox2d& box_map) const;

  std::vector<Piece> pieces_;
  double half_width_m_;
};

}  // namespace stillmap
