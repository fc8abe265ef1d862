#include "core/map/query/plan_shape.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

namespace stillmap {
namespace {

constexpr double grid_steps_per_m = 1 << 20;

/// Positions farther than 2000 km from the origin in an axis are moved there; not for NaN.
GridPoint to_grid(const Eigen::Vector2d& p_map) {
  constexpr double max_coordinate_m = 2e6;
  const auto steps = [&](double value_m) {
    return std::llround(std::clamp(value_m, -max_coordinate_m, max_coordinate_m) *
                        grid_steps_per_m);
  };
  return {steps(p_map.x()), steps(p_map.y())};
}

/// +1 when a, b, c turn left, -1 when they turn right, 0 when they lie on one line.
int orientation(GridPoint a, GridPoint b, GridPoint c) {
  // Differences have at most 43 bits, their products 86.
  __extension__ using Wide = __int128;
  const Wide left = static_cast<Wide>(b.x - a.x) * (c.y - a.y);
  const Wide right = static_cast<Wide>(b.y - a.y) * (c.x - a.x);
  return left > right ? 1 : (left < right ? -1 : 0);
}

/// Whether the boxes round two edges share a point.
bool boxes_intersect(const GridEdge& s, const GridEdge& t) {
  return s.min_x() <= t.max_x() && t.min_x() <= s.max_x() && s.min_y() <= t.max_y() &&
         t.min_y() <= s.max_y();
}

/// Whether two edges share a point.
bool edges_intersect(const GridEdge& s, const GridEdge& t) {
  return boxes_intersect(s, t) && orientation(s.a, s.b, t.a) * orientation(s.a, s.b, t.b) <= 0 &&
         orientation(t.a, t.b, s.a) * orientation(t.a, t.b, s.b) <= 0;
}

/// The grid points round a box, so that the box is inside.
GridEdge diagonal_round(const Eigen::AlignedBox2d& box_map) {
  const GridPoint low = to_grid(box_map.min());
  const GridPoint high = to_grid(box_map.max());
  return {{low.x - 1, low.y - 1}, {high.x + 1, high.y + 1}};
}

/// Whether an edge has a point in the box with this diagonal: it does unless one of the box's axes
/// or the edge's own line keeps them apart.
bool meets_box(const GridEdge& edge, const GridEdge& box) {
  if (!boxes_intersect(edge, box)) return false;
  const int low_left = orientation(edge.a, edge.b, box.a);
  const auto other_side = [&](GridPoint corner) {
    return orientation(edge.a, edge.b, corner) != low_left;
  };
  return low_left == 0 || other_side({box.b.x, box.a.y}) || other_side(box.b) ||
         other_side({box.a.x, box.b.y});
}

/// Edges with one common corner: whether the second goes back along the first.
bool folds_back(const GridEdge& first, const GridEdge& second) {
  if (orientation(first.a, first.b, second.b) != 0) return false;
  return first.a.x != first.b.x ? (first.a.x < first.b.x) != (second.a.x < second.b.x)
                                : (first.a.y < first.b.y) != (second.a.y < second.b.y);
}

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

PolygonShape::PolygonShape(const std::vector<Eigen::Vector2d>& corners_map) {
  for (std::size_t i = 0; i < corners_map.size(); ++i) {
    const GridEdge edge{to_grid(corners_map[i]),
                        to_grid(corners_map[(i + 1) % corners_map.size()])};
    if (edge.a == edge.b) continue;
    edges_.push_back(edge);
    first_corner_.push_back(i);
  }
}

bool PolygonShape::may_intersect(std::size_t i, std::size_t j) const {
  const std::size_t count = edges_.size();
  if ((i + 1) % count == j) return !folds_back(edges_[i], edges_[j]);
  if ((j + 1) % count == i) return !folds_back(edges_[j], edges_[i]);
  return false;
}

std::optional<std::pair<std::size_t, std::size_t>> PolygonShape::crossing() const {
  // Swept from left to right: an edge is compared with those that begin before it ends.
  std::vector<std::size_t> order(edges_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return edges_[i].min_x(); });
  for (auto s = order.begin(); s != order.end(); ++s) {
    for (auto t = s + 1; t != order.end() && edges_[*t].min_x() <= edges_[*s].max_x(); ++t) {
      if (!edges_intersect(edges_[*s], edges_[*t]) || may_intersect(*s, *t)) continue;
      const auto [first, second] = std::minmax(*s, *t);
      return std::pair(first_corner_[first], first_corner_[second]);
    }
  }
  return std::nullopt;
}

bool PolygonShape::has_area() const {
  return std::ranges::any_of(edges_, [&](const GridEdge& edge) {
    return orientation(edges_.front().a, edges_.front().b, edge.b) != 0;
  });
}

bool PolygonShape::contains(const Eigen::Vector2d& p_map) const {
  const GridPoint p = to_grid(p_map);
  bool is_inside = false;
  for (const GridEdge& edge : edges_) {
    if (p.y < edge.min_y() || p.y > edge.max_y() || p.x > edge.max_x()) continue;
    const int side = orientation(edge.a, edge.b, p);
    if (side == 0 && p.x >= edge.min_x()) return true;
    // A ray towards +x; an edge owns its lower end only.
    const bool is_crossed = (edge.a.y <= p.y) != (edge.b.y <= p.y);
    if (is_crossed && (edge.b.y > edge.a.y) == (side > 0)) is_inside = !is_inside;
  }
  return is_inside;
}

bool PolygonShape::outline_intersects(const Eigen::AlignedBox2d& box_map) const {
  const GridEdge box = diagonal_round(box_map);
  return std::ranges::any_of(edges_, [&](const GridEdge& edge) { return meets_box(edge, box); });
}

bool PolygonShape::intersects(const Eigen::AlignedBox2d& box_map) const {
  return outline_intersects(box_map) || contains(box_map.min());
}

bool PolygonShape::covers(const Eigen::AlignedBox2d& box_map) const {
  return !outline_intersects(box_map) && contains(box_map.min());
}

PolygonShape PolygonShape::restricted_to(const Eigen::AlignedBox2d& box_map) const {
  const GridEdge box = diagonal_round(box_map);
  PolygonShape part;
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const GridEdge& edge = edges_[i];
    // Only these can be met by a ray towards +x from a point in the box.
    if (edge.max_x() < box.a.x || edge.max_y() < box.a.y || edge.min_y() > box.b.y) continue;
    part.edges_.push_back(edge);
    part.first_corner_.push_back(first_corner_[i]);
  }
  return part;
}

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
