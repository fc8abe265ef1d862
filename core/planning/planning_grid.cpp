#include "core/planning/planning_grid.hpp"

#include <algorithm>
#include <cmath>

#include "core/planning/planning_stop.hpp"
#include "core/traversability/cell_grid.hpp"

namespace stillmap {
namespace {

// From a cell's centre to its corner [cells], rounded up.
constexpr double half_diagonal = 0.7072;

bool is_closed(const TraversabilityCell& cell, UnknownGround unknown) {
  return cell.is_lethal_itself() ||
         (cell.state == CellState::unknown && unknown == UnknownGround::blocked);
}

/// Cost of a cell, 0 to 1. Unknown ground that may be entered has the highest.
double cost_of(const TraversabilityCell& cell) {
  constexpr double max_cost = 100.0;
  return cell.state == CellState::unknown ? 1.0 : cell.cost / max_cost;
}

CellIndex floor_cell(const Eigen::Vector2d& position_map, double cell_m) {
  const Eigen::Vector2d cell = (position_map / cell_m).array().floor();
  return {static_cast<std::int32_t>(cell.x()), static_cast<std::int32_t>(cell.y())};
}

/// Calls `visit(x, y, cell)` for the cells of a tile that lie in the grid.
template <typename Visit>
void visit_shared(const TraversabilityTile& tile, CellIndex origin,
                  const CellGrid<std::uint8_t>& grid, const Visit& visit) {
  const CellIndex corner{tile.id.x * tile.side - origin.x, tile.id.y * tile.side - origin.y};
  for (int y = std::max(0, -corner.y); y < std::min(tile.side, grid.height() - corner.y); ++y) {
    for (int x = std::max(0, -corner.x); x < std::min(tile.side, grid.width() - corner.x); ++x) {
      visit(corner.x + x, corner.y + y, tile.at(x, y));
    }
  }
}

}  // namespace

double PlanningGrid::cells_for(const Eigen::AlignedBox2d& box_map, double cell_m) {
  return box_map.sizes().prod() / (cell_m * cell_m);
}

PlanningGrid::PlanningGrid(const TraversabilityView& view, const Eigen::AlignedBox2d& box_map,
                           double cost_weight, const std::function<bool()>& should_stop)
    : cell_m_(view.cell_m), profile_(view.profile), bounds_map_(box_map) {
  const int margin =
      2 + static_cast<int>(std::ceil(profile_.circumscribed_radius_m() / cell_m_ + half_diagonal));
  const CellIndex low = floor_cell(box_map.min(), cell_m_);
  const CellIndex high = floor_cell(box_map.max(), cell_m_);
  origin_ = {low.x - margin, low.y - margin};
  const int columns = high.x - low.x + 1 + 2 * margin;
  const int rows = high.y - low.y + 1 + 2 * margin;
  // Cells without a tile are unknown.
  const TraversabilityCell unknown;
  CellGrid<std::uint8_t> closed(columns, rows, is_closed(unknown, profile_.unknown) ? 1 : 0);
  factors_ =
      CellGrid<float>(columns, rows, static_cast<float>(1.0 + cost_weight * cost_of(unknown)));
  const auto poll = [&] { stop_in("the grid of the map's cells was made", should_stop); };
  for (const auto& tile : view.tiles) {
    poll();
    visit_shared(*tile, origin_, closed, [&](int x, int y, const TraversabilityCell& cell) {
      closed(x, y) = is_closed(cell, profile_.unknown) ? 1 : 0;
      factors_(x, y) = static_cast<float>(1.0 + cost_weight * cost_of(cell));
    });
  }
  low_ = cell_of(box_map.min());
  high_ = cell_of(box_map.max());
  const int discs =
      std::max(1, static_cast<int>(std::lround(profile_.length_m / profile_.width_m)));
  const double piece_m = profile_.length_m / discs;
  for (int i = 0; i < discs; ++i) {
    disc_ahead_m_.push_back(profile_.centre_ahead_m + (i + 0.5 - 0.5 * discs) * piece_m);
  }
  // A cell that is touched lies with its centre half a diagonal farther away at most, and so does
  // the centre of a disc from that of its own cell.
  disc_radius_m_ =
      std::hypot(0.5 * piece_m, 0.5 * profile_.width_m) + 2.0 * half_diagonal * cell_m_;
  // Larger distances are never compared: the discs are no smaller than the inscribed circle.
  distances_m_ = distances_to_marked(closed, disc_radius_m_ / cell_m_ + 1.0, poll);
  for_each_cell(closed, [&](int x, int y) {
    distances_m_(x, y) = static_cast<float>(cell_m_ * distances_m_(x, y));
  });
}

CellIndex PlanningGrid::cell_of(const Eigen::Vector2d& position_map) const {
  const CellIndex cell = floor_cell(position_map, cell_m_);
  return {cell.x - origin_.x, cell.y - origin_.y};
}

Eigen::Vector2d PlanningGrid::centre_of(CellIndex cell) const {
  return cell_m_ * Eigen::Vector2d(origin_.x + cell.x + 0.5, origin_.y + cell.y + 0.5);
}

double PlanningGrid::distance_m(const Eigen::Vector2d& position_map) const {
  const CellIndex cell = cell_of(position_map);
  return distances_m_(cell.x, cell.y);
}

bool PlanningGrid::may_stand_in(CellIndex cell) const {
  if (cell.x < low_.x || cell.y < low_.y || cell.x > high_.x || cell.y > high_.y) return false;
  return distances_m_(cell.x, cell.y) + half_diagonal * cell_m_ >= profile_.inscribed_radius_m();
}

bool PlanningGrid::is_free(const PlanarPose& pose) const {
  if (!bounds_map_.contains(pose.position_map)) return false;
  if (distance_m(pose.position_map) + half_diagonal * cell_m_ < profile_.inscribed_radius_m()) {
    return false;
  }
  const Eigen::Vector2d ahead(std::cos(pose.heading_rad), std::sin(pose.heading_rad));
  const bool is_clear = std::ranges::all_of(disc_ahead_m_, [&](double ahead_m) {
    return distance_m(pose.position_map + ahead_m * ahead) > disc_radius_m_;
  });
  return is_clear || !is_closed_under(pose);
}

/// Exact test over the cells of visit_footprint, for poses that the distances do not decide.
bool PlanningGrid::is_closed_under(const PlanarPose& pose) const {
  const FootprintCells cells(profile_, pose, cell_m_);
  for (int y = cells.low().y; y <= cells.high().y; ++y) {
    for (int x = cells.low().x; x <= cells.high().x; ++x) {
      if (distances_m_(x - origin_.x, y - origin_.y) <= 0.0F && cells.has({x, y})) return true;
    }
  }
  return false;
}

}  // namespace stillmap
