#include "core/map/query/corridor_shape.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace stillmap {
namespace {

std::array<Eigen::Vector2d, 4> corners(const Eigen::AlignedBox2d& box) {
  return {box.min(), Eigen::Vector2d(box.max().x(), box.min().y()), box.max(),
          Eigen::Vector2d(box.min().x(), box.max().y())};
}

/// Whether the straight line from a to b enters the box: its parameter is cut by one pair of faces
/// after the other (Liang and Barsky).
bool enters(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::AlignedBox2d& box) {
  double from = 0.0;
  double to = 1.0;
  for (int axis = 0; axis < 2; ++axis) {
    const double step = b[axis] - a[axis];
    if (step == 0.0) {
      if (a[axis] < box.min()[axis] || a[axis] > box.max()[axis]) return false;
      continue;
    }
    const auto [first, last] =
        std::minmax({(box.min()[axis] - a[axis]) / step, (box.max()[axis] - a[axis]) / step});
    from = std::max(from, first);
    to = std::min(to, last);
  }
  return from <= to;
}

}  // namespace

CorridorShape::CorridorShape(const std::vector<Eigen::Vector2d>& path_map, double half_width_m)
    : half_width_m_(half_width_m) {
  for (std::size_t i = 0; i + 1 < path_map.size(); ++i) {
    pieces_.push_back({path_map[i], path_map[i + 1]});
  }
}

Eigen::AlignedBox2d CorridorShape::bounds_map() const {
  Eigen::AlignedBox2d bounds;
  for (const Piece& piece : pieces_) bounds.extend(piece.begin_map).extend(piece.end_map);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(half_width_m_);
  return {bounds.min() - margin, bounds.max() + margin};
}

bool CorridorShape::is_near(const Piece& piece, const Eigen::Vector2d& p_map) const {
  const Eigen::Vector2d along = piece.end_map - piece.begin_map;
  const Eigen::Vector2d offset = p_map - piece.begin_map;
  const double length_squared = along.squaredNorm();
  const double t =
      length_squared > 0.0 ? std::clamp(offset.dot(along) / length_squared, 0.0, 1.0) : 0.0;
  return (offset - t * along).squaredNorm() <= half_width_m_ * half_width_m_;
}

bool CorridorShape::intersects(const Piece& piece, const Eigen::AlignedBox2d& box_map) const {
  const double squared = half_width_m_ * half_width_m_;
  const auto is_near_corner = [&](const Eigen::Vector2d& corner) { return is_near(piece, corner); };
  return box_map.squaredExteriorDistance(piece.begin_map) <= squared ||
         box_map.squaredExteriorDistance(piece.end_map) <= squared ||
         enters(piece.begin_map, piece.end_map, box_map) ||
         std::ranges::any_of(corners(box_map), is_near_corner);
}

bool CorridorShape::contains(const Eigen::Vector2d& p_map) const {
  return std::ranges::any_of(pieces_, [&](const Piece& piece) { return is_near(piece, p_map); });
}

bool CorridorShape::intersects(const Eigen::AlignedBox2d& box_map) const {
  return std::ranges::any_of(pieces_,
                             [&](const Piece& piece) { return intersects(piece, box_map); });
}

bool CorridorShape::covers(const Eigen::AlignedBox2d& box_map) const {
  return std::ranges::any_of(pieces_, [&](const Piece& piece) {
    return std::ranges::all_of(
        corners(box_map), [&](const Eigen::Vector2d& corner) { return is_near(piece, corner); });
  });
}

CorridorShape CorridorShape::restricted_to(const Eigen::AlignedBox2d& box_map) const {
  CorridorShape part(half_width_m_);
  std::ranges::copy_if(pieces_, std::back_inserter(part.pieces_),
                       [&](const Piece& piece) { return intersects(piece, box_map); });
  return part;
}

}  // namespace stillmap
