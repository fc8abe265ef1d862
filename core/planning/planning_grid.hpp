#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/traversability/cell_grid.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Collision and cost grid of a robot for one search. A cell is closed if check_path reports a
/// conflict when the footprint touches it.
class PlanningGrid {
 public:
  /// Covers the box (map frame [m], not empty) and a margin of a footprint on every side. The cost
  /// of a metre is 1 + `cost_weight` * the cell's cost, 0 to 1. Throws PlanningStopped when
  /// `should_stop`, which may be empty, is true meanwhile.
  /// @pre cells_for(box_map, view.cell_m) <= max_cells
  PlanningGrid(const TraversabilityView& view, const Eigen::AlignedBox2d& box_map,
               double cost_weight, const std::function<bool()>& should_stop = {});

  static constexpr double max_cells = 50e6;
  [[nodiscard]] static double cells_for(const Eigen::AlignedBox2d& box_map, double cell_m);

  [[nodiscard]] double cell_m() const { return cell_m_; }
  [[nodiscard]] int width() const { return factors_.width(); }
  [[nodiscard]] int height() const { return factors_.height(); }
  [[nodiscard]] const RobotProfile& profile() const { return profile_; }
  /// Bounds of valid positions, map frame [m].
  [[nodiscard]] const Eigen::AlignedBox2d& bounds_map() const { return bounds_map_; }

  /// The cell that contains a position. @pre bounds_map().contains(position_map)
  [[nodiscard]] CellIndex cell_of(const Eigen::Vector2d& position_map) const;
  [[nodiscard]] Eigen::Vector2d centre_of(CellIndex cell) const;

  /// Whether the footprint touches no closed cell: the same result as check_path's for that pose.
  /// False outside the bounds.
  [[nodiscard]] bool is_free(const PlanarPose& pose) const;
  /// Whether a pose in the cell can be free at some heading. Conservative: false only if none can.
  [[nodiscard]] bool may_stand_in(CellIndex cell) const;
  /// Cost of a metre in the cell, 1 or more.
  [[nodiscard]] double cost_factor(CellIndex cell) const { return factors_(cell.x, cell.y); }

 private:
  [[nodiscard]] double distance_m(const Eigen::Vector2d& position_map) const;
  [[nodiscard]] bool is_closed_under(const PlanarPose& pose) const;

  double cell_m_;
  RobotProfile profile_;
  CellIndex origin_;
  Eigen::AlignedBox2d bounds_map_;
  /// Cells of the bounds' corners.
  CellIndex low_;
  CellIndex high_;
  /// To the nearest closed cell, whose own distance is 0; exact up to the radius of the discs.
  CellGrid<float> distances_m_;
  CellGrid<float> factors_;
  /// Discs along the robot's axis that cover the footprint and all cells that it touches.
  std::vector<double> disc_ahead_m_;
  double disc_radius_m_ = 0.0;
};

}  // namespace stillmap
