#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace stillmap {

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
