#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/traversability/ground_estimate.hpp"

namespace stillmap {
namespace {

/// Longest gap that is filled without ground in a third direction [m].
constexpr double max_bare_gap_m = 1.6;
/// Largest distance of that ground [m].
constexpr double max_third_direction_m = 2.4;
/// Ground that was measured so densely before both ends of a gap that what leaves the gap is not
/// the distance of the rings: cells in a row, and how many of them were seen.
constexpr int bank_cells = 5;
constexpr int min_bank_seen = 4;
/// A gap between them that is longer than this is filled where it is that of a hole, the footprint
/// of a vehicle, which is no longer in any direction than that [m].
constexpr double max_strip_m = 0.9;
constexpr double max_hole_m = 8.0;
/// What ends a hole lies within so much of the level that the ground round it leads to [m]: not
/// what hangs over it or is mirrored in it.
constexpr double hole_end_m = 0.5;
/// Tolerance of the far end from the extrapolated slopes: constant [m] and per metre of gap.
constexpr double step_m = 0.06;
constexpr double slope_doubt = 0.01;
/// Tolerance of ground in the third direction, per metre, beside `step_m`: it lies across the line,
/// where a road's camber falls off.
constexpr double cross_slope = 0.06;
/// Largest difference of the heights of two lines [m].
constexpr double disagreement_m = 0.10;
/// Cells over which the slope at an end is measured.
constexpr int slope_cells = 5;
/// Height range above the ground of objects that block a gap, and depth of what falls away [m],
/// which is farther down a slope by so much per metre.
constexpr float object_from_m = 0.25F;
constexpr float object_to_m = 2.0F;
constexpr double fall_slope = 0.3;
/// The same where the ground on the far side was not seen, so that a bank may go on down.
constexpr double open_fall_slope = 0.6;
/// Cells beside the bottom of a pit that were measured as far down.
constexpr int min_pit_neighbours = 2;

struct Direction {
  int dx;
  int dy;
  [[nodiscard]] double length() const { return std::hypot(dx, dy); }
};

/// Four lines; the opposite of i is i + 4.
constexpr std::array<Direction, 8> directions{
    {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
constexpr std::size_t line_count = 4;
/// Lines to the end of a hole, at most 12 degrees apart: a strip may run anyhow, and one of
/// `max_strip_m` is longer than `max_hole_m` along the one that is nearest to it.
constexpr std::array<Direction, 16> closing_lines{{{1, 0},
                                                   {5, 1},
                                                   {5, 2},
                                                   {3, 2},
                                                   {1, 1},
                                                   {2, 3},
                                                   {2, 5},
                                                   {1, 5},
                                                   {0, 1},
                                                   {-1, 5},
                                                   {-2, 5},
                                                   {-2, 3},
                                                   {-1, 1},
                                                   {-3, 2},
                                                   {-5, 2},
                                                   {-5, 1}}};

/// Number of cells to the nearest ground in one direction; 0 without any in reach.
using Reach = std::int16_t;

/// Classes that lie at one level count as one.
int group_of(SemanticClass label) {
  const bool is_carriageway = label == SemanticClass::road || label == SemanticClass::parking ||
                              label == SemanticClass::other_ground;
  return static_cast<int>(is_carriageway ? SemanticClass::road : label);
}

bool has_object(Column column, float ground_m) {
  return std::ranges::any_of(column, [ground_m](const ColumnVoxel& voxel) {
    const float above_m = voxel.height_m - ground_m;
    return above_m > object_from_m && above_m < object_to_m;
  });
}

/// Whether the column was measured farther down than ground falls off so far from ground.
bool falls_away(Column column, float ground_m, double distance_m, double slope = fall_slope) {
  const double fall_m = object_from_m + slope * distance_m;
  return !column.empty() && column.front().height_m < ground_m - fall_m;
}

/// Whether the column has what may be ground at a level: the rim of a pit, a plank over it, or the
/// road above its own reflections.
bool has_surface_at(Column column, float level_m) {
  return std::ranges::any_of(column, [level_m](const ColumnVoxel& voxel) {
    return (is_ground(voxel.label) || voxel.label == SemanticClass::unlabeled) &&
           std::abs(voxel.height_m - level_m) <= object_from_m;
  });
}

GroundCell assumed_at(float height_m) {
  return {.height_m = height_m, .top_m = height_m, .origin = GroundOrigin::assumed};
}

/// Nearest ground in eight directions of every cell without ground.
class Holes {
 public:
  Holes(const GroundGrid& seen, const ColumnGrid& columns, double cell_m)
      : seen_(seen), columns_(columns), cell_m_(cell_m) {
    for (std::size_t i = 0; i < directions.size(); ++i) find_reach(i);
  }

  /// Interpolated ground of the cell, if it can be filled.
  [[nodiscard]] std::optional<GroundCell> inferred(int x, int y) const;
  /// Height of the nearest ground in any direction, whatever lies before it: what stands beside it
  /// stands on it.
  [[nodiscard]] std::optional<float> nearest_height(int x, int y) const;
  /// The cell as the bottom of a pit, if it is one.
  [[nodiscard]] std::optional<GroundCell> pit_bottom(int x, int y) const;

 private:
  struct End {
    double distance_m;
    const GroundCell* cell;
    int x, y;
  };
  struct Line {
    double gap_m;
    GroundCell cell;
  };

  void find_reach(std::size_t direction);
  [[nodiscard]] Reach cells_to_ground(const CellGrid<Reach>& reach, int x, int y,
                                      std::size_t direction) const;
  [[nodiscard]] Reach reach_from(int x, int y, std::size_t direction) const;
  [[nodiscard]] std::optional<End> end(int x, int y, std::size_t direction) const;
  /// Nearest ground, whatever lies before it.
  [[nodiscard]] std::optional<End> edge(int x, int y, std::size_t direction) const;
  [[nodiscard]] End end_after(int x, int y, std::size_t direction, Reach cells) const;
  [[nodiscard]] std::optional<float> pit_edge_m(int x, int y, std::size_t direction) const;
  [[nodiscard]] std::optional<double> slope_at(const End& end, Direction outwards) const;
  [[nodiscard]] bool is_one_surface(const End& a, const End& b, std::size_t direction) const;
  [[nodiscard]] std::optional<Line> line_through(int x, int y, std::size_t direction) const;
  /// Whether the cell was measured farther down than ground falls off so far from ground, and one
  /// beside it, too: one alone may be a reflection.
  [[nodiscard]] bool is_in_pit(int x, int y, float ground_m, double distance_m) const;
  /// Cells beside it that were measured farther down than ground falls off with a slope.
  [[nodiscard]] std::ptrdiff_t fallen_neighbours(int x, int y, float ground_m, double distance_m,
                                                 double slope) const;
  [[nodiscard]] bool has_third_direction(int x, int y, std::size_t direction,
                                         const GroundCell& cell) const;
  /// Whether the ground was measured densely from an end on.
  [[nodiscard]] bool is_bank(const End& end, Direction outwards) const;
  /// Rise of the ground round a hole from a level in one of its cells: what the ends in eight
  /// directions have in common [m per cell].
  [[nodiscard]] Eigen::Vector2d slope_around(int x, int y, double level_m) const;
  /// Whether the hole round a cell, where the ground is at a level, ends within `max_hole_m`
  /// whatever line is followed through it.
  [[nodiscard]] bool is_enclosed(int x, int y, double level_m) const;
  /// Cells along a line from a cell of a hole to where that ends; `limit` where it does not.
  [[nodiscard]] int cells_to_end(int x, int y, double level_m, const Eigen::Vector2d& slope,
                                 Direction d, int limit) const;

  const GroundGrid& seen_;
  const ColumnGrid& columns_;
  double cell_m_;
  /// Not through objects and pits.
  std::array<CellGrid<Reach>, directions.size()> reach_;
  /// Through anything.
  std::array<CellGrid<Reach>, directions.size()> edge_reach_;
};

/// Computes the reach of all cells in one direction, from the far side of the grid back: each cell
/// needs its neighbour's result only.
void Holes::find_reach(std::size_t direction) {
  const Direction d = directions.at(direction);
  reach_.at(direction) = CellGrid<Reach>(seen_.width(), seen_.height(), 0);
  edge_reach_.at(direction) = reach_.at(direction);
  for (int row = 0; row < seen_.height(); ++row) {
    const int y = d.dy > 0 ? seen_.height() - 1 - row : row;
    for (int column = 0; column < seen_.width(); ++column) {
      const int x = d.dx > 0 ? seen_.width() - 1 - column : column;
      if (seen_(x, y).is_known()) continue;
      edge_reach_.at(direction)(x, y) = cells_to_ground(edge_reach_.at(direction), x, y, direction);
      reach_.at(direction)(x, y) = reach_from(x, y, direction);
    }
  }
}

/// From the reach of the next cell; 0 if that has none or the ground is too far.
Reach Holes::cells_to_ground(const CellGrid<Reach>& reach, int x, int y,
                             std::size_t direction) const {
  const Direction d = directions.at(direction);
  const int next_x = x + d.dx;
  const int next_y = y + d.dy;
  if (!seen_.contains(next_x, next_y)) return 0;
  int cells = 1;
  if (!seen_(next_x, next_y).is_known()) {
    const Reach further = reach(next_x, next_y);
    if (further == 0) return 0;
    cells += further;
  }
  return cells * d.length() * cell_m_ > max_filled_gap_m ? Reach{0} : static_cast<Reach>(cells);
}

Reach Holes::reach_from(int x, int y, std::size_t direction) const {
  const Reach cells = cells_to_ground(reach_.at(direction), x, y, direction);
  if (cells == 0) return 0;
  const End end = end_after(x, y, direction, cells);
  const float end_m = end.cell->height_m;
  if (has_object(columns_(x, y), end_m)) return 0;
  if (is_in_pit(x, y, end_m, end.distance_m)) return 0;
  // The wall of a pit may lie below the ground at its edge.
  if (cells == 1 && is_in_pit(end.x, end.y, end_m, 0.0)) return 0;
  return cells;
}

Holes::End Holes::end_after(int x, int y, std::size_t direction, Reach cells) const {
  const Direction d = directions.at(direction);
  const int end_x = x + cells * d.dx;
  const int end_y = y + cells * d.dy;
  return {cells * d.length() * cell_m_, &seen_(end_x, end_y), end_x, end_y};
}

std::optional<Holes::End> Holes::end(int x, int y, std::size_t direction) const {
  const Reach cells = reach_.at(direction)(x, y);
  if (cells == 0) return std::nullopt;
  return end_after(x, y, direction, cells);
}

std::optional<Holes::End> Holes::edge(int x, int y, std::size_t direction) const {
  const Reach cells = edge_reach_.at(direction)(x, y);
  if (cells == 0) return std::nullopt;
  return end_after(x, y, direction, cells);
}

/// Rise per metre towards the hole, from the ground farther out.
std::optional<double> Holes::slope_at(const End& end, Direction outwards) const {
  for (int cells = slope_cells; cells >= 2; --cells) {
    const int x = end.x + cells * outwards.dx;
    const int y = end.y + cells * outwards.dy;
    if (!seen_.contains(x, y) || !seen_(x, y).is_known()) continue;
    if (group_of(seen_(x, y).label) != group_of(end.cell->label)) continue;
    return (end.cell->height_m - seen_(x, y).height_m) / (cells * outwards.length() * cell_m_);
  }
  return std::nullopt;
}

bool Holes::is_one_surface(const End& a, const End& b, std::size_t direction) const {
  if (group_of(a.cell->label) != group_of(b.cell->label)) return false;
  const std::optional<double> slope_a = slope_at(a, directions.at(direction));
  const std::optional<double> slope_b = slope_at(b, directions.at(direction + line_count));
  double slope = 0.0;
  if (slope_a && slope_b) {
    slope = 0.5 * (*slope_a - *slope_b);
  } else if (slope_a || slope_b) {
    slope = slope_a ? *slope_a : -*slope_b;
  }
  const double gap_m = a.distance_m + b.distance_m;
  const double off_m = b.cell->height_m - (a.cell->height_m + slope * gap_m);
  return std::abs(off_m) <= step_m + slope_doubt * gap_m;
}

std::optional<Holes::Line> Holes::line_through(int x, int y, std::size_t direction) const {
  const std::optional<End> a = end(x, y, direction);
  const std::optional<End> b = end(x, y, direction + line_count);
  if (!a || !b || a->distance_m + b->distance_m > max_filled_gap_m) return std::nullopt;
  if (!is_one_surface(*a, *b, direction)) return std::nullopt;
  Line line;
  line.gap_m = a->distance_m + b->distance_m;
  const double share = a->distance_m / line.gap_m;
  const double height_m = (1.0 - share) * a->cell->height_m + share * b->cell->height_m;
  line.cell.height_m = line.cell.top_m = static_cast<float>(height_m);
  line.cell.origin = GroundOrigin::inferred;
  line.cell.label = a->distance_m <= b->distance_m ? a->cell->label : b->cell->label;
  if (line.gap_m > max_bare_gap_m && !has_third_direction(x, y, direction, line.cell))
    return std::nullopt;
  if (line.gap_m > max_strip_m && is_bank(*a, directions.at(direction)) &&
      is_bank(*b, directions.at(direction + line_count)) && !is_enclosed(x, y, height_m))
    return std::nullopt;
  return line;
}

bool Holes::is_bank(const End& end, Direction outwards) const {
  int seen = 0;
  for (int i = 0; i < bank_cells; ++i) {
    const int x = end.x + i * outwards.dx;
    const int y = end.y + i * outwards.dy;
    if (seen_.contains(x, y) && seen_(x, y).is_known()) ++seen;
  }
  return seen >= min_bank_seen;
}

Eigen::Vector2d Holes::slope_around(int x, int y, double level_m) const {
  // A little of no slope, for ends in one line only.
  Eigen::Matrix2d squares = Eigen::Matrix2d::Identity();
  Eigen::Vector2d products = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const std::optional<End> one = end(x, y, i);
    if (!one) continue;
    const double rise_m = one->cell->height_m - level_m;
    if (std::abs(rise_m) > open_fall_slope * one->distance_m) continue;
    const Eigen::Vector2d offset(one->x - x, one->y - y);
    squares += offset * offset.transpose();
    products += offset * rise_m;
  }
  return squares.ldlt().solve(products);
}

int Holes::cells_to_end(int x, int y, double level_m, const Eigen::Vector2d& slope, Direction d,
                        int limit) const {
  const int longer = std::max(std::abs(d.dx), std::abs(d.dy));
  for (int i = 1; i < limit; ++i) {
    // Every cell that the line crosses, not only those on its corners.
    const double share = static_cast<double>(i) / longer;
    const Eigen::Vector2i offset(static_cast<int>(std::lround(share * d.dx)),
                                 static_cast<int>(std::lround(share * d.dy)));
    if (!seen_.contains(x + offset.x(), y + offset.y())) return limit;
    const double end_m = level_m + slope.dot(offset.cast<double>());
    const Column column = columns_(x + offset.x(), y + offset.y());
    if (std::ranges::any_of(column, [end_m](const ColumnVoxel& voxel) {
          return std::abs(voxel.height_m - end_m) <= hole_end_m;
        })) {
      return i;
    }
  }
  return limit;
}

bool Holes::is_enclosed(int x, int y, double level_m) const {
  const Eigen::Vector2d slope = slope_around(x, y, level_m);
  return std::ranges::all_of(closing_lines, [&](const Direction& d) {
    const double length_m = d.length() / std::max(std::abs(d.dx), std::abs(d.dy)) * cell_m_;
    // Ends lie one cell farther apart than the hole is long.
    const int longest = static_cast<int>(max_hole_m / length_m) + 1;
    const int ahead = cells_to_end(x, y, level_m, slope, d, longest);
    return ahead < longest &&
           ahead + cells_to_end(x, y, level_m, slope, {-d.dx, -d.dy}, longest) <= longest;
  });
}

bool Holes::has_third_direction(int x, int y, std::size_t direction, const GroundCell& cell) const {
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (i % line_count == direction) continue;
    const std::optional<End> third = end(x, y, i);
    if (!third || third->distance_m > max_third_direction_m) continue;
    if (group_of(third->cell->label) != group_of(cell.label)) continue;
    const double off_m = std::abs(third->cell->height_m - cell.height_m);
    if (off_m <= step_m + cross_slope * third->distance_m) return true;
  }
  return false;
}

std::optional<GroundCell> Holes::inferred(int x, int y) const {
  std::optional<Line> best;
  for (std::size_t i = 0; i < line_count; ++i) {
    const std::optional<Line> line = line_through(x, y, i);
    if (!line) continue;
    if (best && std::abs(best->cell.height_m - line->cell.height_m) > disagreement_m) return {};
    if (!best || line->gap_m < best->gap_m) best = line;
  }
  if (!best || is_in_pit(x, y, best->cell.height_m, 0.0)) return std::nullopt;
  return best->cell;
}

bool Holes::is_in_pit(int x, int y, float ground_m, double distance_m) const {
  return falls_away(columns_(x, y), ground_m, distance_m) &&
         fallen_neighbours(x, y, ground_m, distance_m, fall_slope) > 0;
}

std::ptrdiff_t Holes::fallen_neighbours(int x, int y, float ground_m, double distance_m,
                                        double slope) const {
  return std::ranges::count_if(directions, [&](const Direction& d) {
    return columns_.contains(x + d.dx, y + d.dy) &&
           falls_away(columns_(x + d.dx, y + d.dy), ground_m, distance_m + d.length() * cell_m_,
                      slope);
  });
}

/// The lower ground at the ends of a line through the cell, if that is the bottom of a pit between
/// them. On a slope, one end is as low as the cell.
std::optional<float> Holes::pit_edge_m(int x, int y, std::size_t direction) const {
  const std::optional<End> a = edge(x, y, direction);
  const std::optional<End> b = edge(x, y, direction + line_count);
  std::optional<float> edge_m;
  for (const std::optional<End>& one : {a, b}) {
    if (!one) continue;
    const float ground_m = one->cell->height_m;
    double slope = a && b ? fall_slope : open_fall_slope;
    // Of a wide one that is not deep, the far edge lies no steeper than a slope.
    if (a && b && one->distance_m > std::min(a->distance_m, b->distance_m)) slope = 0.0;
    if (!falls_away(columns_(x, y), ground_m, one->distance_m, slope)) return std::nullopt;
    if (fallen_neighbours(x, y, ground_m, one->distance_m, slope) < min_pit_neighbours)
      return std::nullopt;
    if (has_surface_at(columns_(x, y), ground_m)) return std::nullopt;
    edge_m = std::min(edge_m.value_or(ground_m), ground_m);
  }
  return edge_m;
}

std::optional<GroundCell> Holes::pit_bottom(int x, int y) const {
  std::optional<GroundCell> bottom;
  for (std::size_t i = 0; i < line_count; ++i) {
    const std::optional<float> edge_m = pit_edge_m(x, y, i);
    if (!edge_m || (bottom && *edge_m <= bottom->height_m)) continue;
    bottom = assumed_at(*edge_m);
    bottom->origin = GroundOrigin::pit;
  }
  return bottom;
}

std::optional<float> Holes::nearest_height(int x, int y) const {
  std::optional<End> nearest;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const std::optional<End> one = edge(x, y, i);
    if (one && (!nearest || one->distance_m < nearest->distance_m)) nearest = one;
  }
  if (!nearest) return std::nullopt;
  return nearest->cell->height_m;
}

}  // namespace

GroundGrid fill_holes(const GroundGrid& seen, const ColumnGrid& columns, const GroundLevel& level,
                      double cell_m, int border) {
  const Holes holes(seen, columns, cell_m);
  GroundGrid filled = seen;
  for_each_cell(seen, [&](int x, int y) {
    if (seen(x, y).is_known()) return;
    if (!seen.contains(x - border, y - border) || !seen.contains(x + border, y + border)) {
      // No slope leads through what was measured there, either (shape_at).
      if (!columns(x, y).empty()) filled(x, y) = assumed_at(columns(x, y).front().height_m);
      return;
    }
    if (const std::optional<GroundCell> ground = holes.inferred(x, y)) {
      filled(x, y) = *ground;
    } else if (const std::optional<GroundCell> bottom = holes.pit_bottom(x, y)) {
      filled(x, y) = *bottom;
    } else if (!columns(x, y).empty()) {
      const float level_m =
          std::isnan(level.at(x, y)) ? columns(x, y).front().height_m : level.at(x, y);
      filled(x, y) = assumed_at(holes.nearest_height(x, y).value_or(level_m));
    }
  });
  return filled;
}

}  // namespace stillmap
