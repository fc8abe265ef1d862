#include "core/traversability/surface_tile.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <optional>
#include <utility>

#include "core/traversability/ground_estimate.hpp"

namespace stillmap {
namespace {

/// Radius of the plane fit [m].
constexpr double plane_reach_m = 0.5;
/// Ground on the far side of what has none is another surface if it lies off by more: height
/// difference [m] and rise per metre.
constexpr double apart_m = 0.1;
constexpr double apart_slope = 0.6;
/// Ground beyond unknown ground may lie off the slope that leads there by so much: height
/// difference [m] and rise per metre.
constexpr double unseen_drop_m = 0.25;
constexpr double unseen_slope = 0.5;
/// From this slope on the lower ground beyond unknown ground lies behind an edge as likely as on a
/// slope: a lidar that sees over an edge sees no slope as steep as it looks down.
constexpr double hidden_slope = 0.3;
/// Distance on either side up to which the rise without the step is measured [cells].
constexpr int rise_cells = 3;

int plane_reach_cells(double cell_m) {
  return std::max(1, static_cast<int>(std::lround(plane_reach_m / cell_m)));
}

/// Reach of `shape_at`: known cells farther away have no influence but beyond unknown ones.
int shape_reach_cells(double cell_m) { return std::max(rise_cells, plane_reach_cells(cell_m)); }

std::optional<double> height_at(const GroundGrid& ground, int x, int y) {
  if (!ground.contains(x, y) || !ground(x, y).is_known()) return std::nullopt;
  return ground(x, y).height_m;
}

/// Sums for the least-squares plane z = a x + b y + c around a cell.
struct PlaneFit {
  double x = 0.0, y = 0.0, z = 0.0;
  double xx = 0.0, xy = 0.0, yy = 0.0;
  double xz = 0.0, yz = 0.0, zz = 0.0;
  int count = 0;

  void add(double x_m, double y_m, double z_m) {
    x += x_m, y += y_m, z += z_m;
    xx += x_m * x_m, xy += x_m * y_m, yy += y_m * y_m;
    xz += x_m * z_m, yz += y_m * z_m, zz += z_m * z_m;
    ++count;
  }
};

/// Whether a known cell at an offset is the ground above or below a wall: steeply off, and with
/// cells between that are unknown.
bool is_apart(const GroundGrid& ground, int x, int y, int dx, int dy, double cell_m) {
  const double rise_m = ground(x + dx, y + dy).height_m - ground(x, y).height_m;
  if (std::abs(rise_m) <= apart_m + apart_slope * cell_m * std::hypot(dx, dy)) return false;
  const int cells = std::max(std::abs(dx), std::abs(dy));
  for (int i = 1; i < cells; ++i) {
    const double share = static_cast<double>(i) / cells;
    const int between_x = x + static_cast<int>(std::lround(share * dx));
    const int between_y = y + static_cast<int>(std::lround(share * dy));
    if (!ground(between_x, between_y).is_known()) return true;
  }
  return false;
}

PlaneFit plane_around(const GroundGrid& ground, int x0, int y0, double cell_m) {
  const int reach = plane_reach_cells(cell_m);
  const GroundCell& middle = ground(x0, y0);
  PlaneFit fit;
  for (int y = std::max(0, y0 - reach); y <= std::min(y0 + reach, ground.height() - 1); ++y) {
    for (int x = std::max(0, x0 - reach); x <= std::min(x0 + reach, ground.width() - 1); ++x) {
      const GroundCell& cell = ground(x, y);
      if (!cell.is_known() || cell.label != middle.label) continue;
      // Relative heights, for the precision of the sums.
      const double rise_m = cell.height_m - middle.height_m;
      if (std::abs(rise_m) > apart_m && is_apart(ground, x0, y0, x - x0, y - y0, cell_m)) continue;
      fit.add((x - x0) * cell_m, (y - y0) * cell_m, rise_m);
    }
  }
  return fit;
}

void set_plane(const PlaneFit& fit, SurfaceShape& shape) {
  constexpr int enough = 5;
  if (fit.count < enough) return;
  // Centred on the mean, c vanishes.
  const double n = fit.count;
  const double xx = fit.xx - fit.x * fit.x / n;
  const double xy = fit.xy - fit.x * fit.y / n;
  const double yy = fit.yy - fit.y * fit.y / n;
  const double xz = fit.xz - fit.x * fit.z / n;
  const double yz = fit.yz - fit.y * fit.z / n;
  const double zz = fit.zz - fit.z * fit.z / n;
  const double determinant = xx * yy - xy * xy;
  // Collinear cells do not determine a plane.
  if (!(determinant > 1e-6 * (xx + yy) * (xx + yy))) return;
  const double a = (yy * xz - xy * yz) / determinant;
  const double b = (xx * yz - xy * xz) / determinant;
  shape.slope = static_cast<float>(std::atan(std::hypot(a, b)));
  const double rest = std::max(0.0, zz - a * xz - b * yz);
  shape.roughness_m = static_cast<float>(std::sqrt(rest / n));
}

/// Rise per cell on one side: the smaller of those from the nearest cell to the next and on to the
/// last of `rise_cells`, and none where they differ in sign. A slope has both; of the rest of a
/// blurred edge, or of the next step, one.
std::optional<double> rise_beyond(const GroundGrid& ground, int x, int y, std::pair<int, int> d,
                                  int sign) {
  static_assert(rise_cells == 3);
  const auto near_m = height_at(ground, x + sign * d.first, y + sign * d.second);
  const auto middle_m = height_at(ground, x + sign * 2 * d.first, y + sign * 2 * d.second);
  const auto far_m = height_at(ground, x + sign * 3 * d.first, y + sign * 3 * d.second);
  if (!near_m || !middle_m || !far_m) return std::nullopt;
  const double first_m = sign * (*middle_m - *near_m);
  const double second_m = sign * (*far_m - *middle_m);
  if (first_m * second_m <= 0.0) return 0.0;
  return std::abs(first_m) < std::abs(second_m) ? first_m : second_m;
}

/// Rise per cell of the four steps between cells beyond either side: their median where the middle
/// two agree in sign, else none. Noise, which spoils one of two, leaves a slope in four; of an edge
/// or of the next step one has anything.
std::optional<double> rise_around(const GroundGrid& ground, int x, int y, std::pair<int, int> d) {
  std::array<double, 4> rises_m{};
  std::size_t count = 0;
  for (const int sign : {-1, 1}) {
    for (const int i : {1, 2}) {
      const auto near_m = height_at(ground, x + sign * i * d.first, y + sign * i * d.second);
      const auto far_m =
          height_at(ground, x + sign * (i + 1) * d.first, y + sign * (i + 1) * d.second);
      if (!near_m || !far_m) return std::nullopt;
      rises_m.at(count++) = sign * (*far_m - *near_m);
    }
  }
  std::ranges::sort(rises_m);
  if (rises_m[1] * rises_m[2] <= 0.0) return std::nullopt;
  return 0.5 * (rises_m[1] + rises_m[2]);
}

double step_along(const GroundGrid& ground, int x, int y, std::pair<int, int> d) {
  const double here_m = ground(x, y).height_m;
  const auto before_m = height_at(ground, x - d.first, y - d.second);
  const auto after_m = height_at(ground, x + d.first, y + d.second);
  const int cells = (before_m ? 1 : 0) + (after_m ? 1 : 0);
  const double difference_m = after_m.value_or(here_m) - before_m.value_or(here_m);
  // The rise of the steeper side; at a ramp's foot it explains the whole difference.
  double explained_m = 0.0;
  for (const auto& rise_m : {rise_beyond(ground, x, y, d, -1), rise_beyond(ground, x, y, d, 1),
                             rise_around(ground, x, y, d)}) {
    if (!rise_m || *rise_m * difference_m <= 0.0) continue;
    if (std::abs(*rise_m * cells) > std::abs(explained_m)) explained_m = *rise_m * cells;
  }
  return std::max(0.0, std::abs(difference_m) - std::abs(explained_m));
}

/// How much lower the first known cell beyond unknown ones lies, and how far away: lower than the
/// slope before the gap leads to, or, negative, higher.
struct BeyondUnknown {
  double drop_m = 0.0;
  double distance_m = 0.0;

  /// Whether a slope (rise per metre) may lead there.
  [[nodiscard]] bool is_on_slope(double slope) const {
    return std::abs(drop_m) <= std::max(unseen_drop_m, slope * distance_m);
  }
};

/// Rise per cell from the last ground before a cell on one side, across what is unknown: of single
/// rows. None through objects, from too near to tell a slope from an edge, or steeper than any
/// slope.
double rise_across(const GroundGrid& ground, int x, int y, std::pair<int, int> d, int sign,
                   double cell_m) {
  const double length_m = cell_m * std::hypot(d.first, d.second);
  const int cells = static_cast<int>(max_filled_gap_m / length_m);
  std::optional<double> near_m;
  for (int i = 1; i <= cells; ++i) {
    const int last_x = x + sign * i * d.first;
    const int last_y = y + sign * i * d.second;
    if (!ground.contains(last_x, last_y)) return 0.0;
    const GroundCell& last = ground(last_x, last_y);
    if (last.origin == GroundOrigin::assumed || last.origin == GroundOrigin::pit) return 0.0;
    if (!last.is_known()) continue;
    const double away_m = last.height_m - ground(x, y).height_m;
    const double rise_m = sign * away_m / i;
    if (i < rise_cells) {
      near_m = rise_m;
      continue;
    }
    // A platform of two or three cells is no slope.
    if (near_m && *near_m * rise_m < 0.5 * rise_m * rise_m) return 0.0;
    return std::abs(rise_m) <= unseen_slope * length_m ? rise_m : 0.0;
  }
  return 0.0;
}

/// Nothing where the next cell is known, or none within `max_filled_gap_m`.
std::optional<BeyondUnknown> beyond_unknown(const GroundGrid& ground, int x, int y,
                                            std::pair<int, int> d, int sign, double cell_m) {
  const double length_m = cell_m * std::hypot(d.first, d.second);
  const int cells = static_cast<int>(max_filled_gap_m / length_m);
  for (int i = 1; i <= cells; ++i) {
    const auto beyond_m = height_at(ground, x + sign * i * d.first, y + sign * i * d.second);
    if (!beyond_m) continue;
    if (i == 1) return std::nullopt;
    // What stands between is in the way of a robot down here; up there the drop is.
    const bool is_wall =
        ground(x + sign * d.first, y + sign * d.second).origin == GroundOrigin::assumed;
    if (is_wall && *beyond_m > ground(x, y).height_m) return std::nullopt;
    const double fall_m = ground(x, y).height_m - *beyond_m;
    // A slope goes on beyond the gap as it comes to it.
    if (const auto outwards_m = rise_beyond(ground, x, y, d, -sign))
      return BeyondUnknown{fall_m + sign * *outwards_m * i, i * length_m};
    // That between single rows may explain what lies there, but not add to it.
    const double off_m = fall_m + sign * rise_across(ground, x, y, d, -sign, cell_m) * i;
    return BeyondUnknown{std::abs(off_m) < std::abs(fall_m) ? off_m : fall_m, i * length_m};
  }
  return std::nullopt;
}

/// Adds the step and the hidden drop beyond unknown ground to either side.
void add_beyond_unknown(const GroundGrid& ground, int x, int y, std::pair<int, int> d,
                        double cell_m, SurfaceShape& shape) {
  for (const int sign : {-1, 1}) {
    const auto beyond = beyond_unknown(ground, x, y, d, sign, cell_m);
    if (!beyond) continue;
    const auto drop_m = static_cast<float>(beyond->drop_m);
    if (!beyond->is_on_slope(unseen_slope)) shape.step_m = std::max(shape.step_m, std::abs(drop_m));
    if (!beyond->is_on_slope(hidden_slope))
      shape.hidden_drop_m = std::max(shape.hidden_drop_m, drop_m);
  }
}

static_assert(surface_reach_m > max_filled_gap_m + 1.0, "both ends of a gap need their slopes");

/// Objects higher above the ground than this are above every robot [m].
constexpr float max_object_height_m = 12.0F;

void add_objects(SurfaceTile& tile, const GroundCell& ground, Column column) {
  for (const ColumnVoxel& voxel : column) {
    const float above_m = voxel.height_m - ground.height_m;
    if (voxel.height_m > ground.top_m && above_m <= max_object_height_m)
      tile.object_heights_m.push_back(above_m);
  }
}

}  // namespace

SurfaceShape shape_at(const GroundGrid& ground, int x, int y, double cell_m) {
  assert(ground(x, y).is_known());
  SurfaceShape shape;
  set_plane(plane_around(ground, x, y, cell_m), shape);
  constexpr std::array<std::pair<int, int>, 4> lines{{{1, 0}, {1, 1}, {0, 1}, {-1, 1}}};
  for (const auto& line : lines) {
    shape.step_m = std::max(shape.step_m, static_cast<float>(step_along(ground, x, y, line)));
    add_beyond_unknown(ground, x, y, line, cell_m, shape);
  }
  return shape;
}

SurfaceTile make_surface(const TileNeighbourhood<ColumnTile>& columns, double cell_m) {
  const int margin = std::min(columns.side, static_cast<int>(std::ceil(surface_reach_m / cell_m)));
  const ColumnGrid window = columns.window<Column>(margin, {});
  const GroundLevel level(window, cell_m);
  const int border = std::max(0, margin - shape_reach_cells(cell_m));
  const GroundGrid ground =
      fill_holes(seen_ground(window, level, cell_m), window, level, cell_m, border);
  SurfaceTile tile;
  tile.side = columns.side;
  for (int y = margin; y < margin + tile.side; ++y) {
    for (int x = margin; x < margin + tile.side; ++x) {
      SurfaceCell cell;
      cell.ground = ground(x, y);
      if (cell.ground.is_known()) {
        cell.shape = shape_at(ground, x, y, cell_m);
      } else if (cell.ground.origin == GroundOrigin::pit) {
        cell.shape.step_m = cell.ground.height_m - window(x, y).front().height_m;
      }
      tile.cells.push_back(cell);
      tile.begin.push_back(static_cast<std::uint32_t>(tile.object_heights_m.size()));
      if (cell.ground.origin != GroundOrigin::none) add_objects(tile, cell.ground, window(x, y));
    }
  }
  tile.begin.push_back(static_cast<std::uint32_t>(tile.object_heights_m.size()));
  return tile;
}

}  // namespace stillmap
