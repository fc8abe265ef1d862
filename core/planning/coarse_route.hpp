#pragma once

#include <optional>
#include <vector>

#include "core/planning/planning_grid.hpp"

namespace stillmap {

/// The way that a disc of the robot's inscribed radius would take: no path of the robot exists
/// where there is none, but the robot may be too long for it, or turn too wide.
struct CoarseRoute {
  /// From the start to the goal, map frame [m], about `step_m` apart.
  std::vector<Eigen::Vector2d> points_map;
  /// Lower limit of spacing; twice the cells of the map or more [m].
  double step_m = 0.0;
  double length_m = 0.0;
  /// Metres, each times the cost of its cell: hardly a path costs less.
  double cost = 0.0;
};

/// The cheapest way over cells of at least 0.4 m by A*; nothing when the goal cannot be reached.
/// @pre both places are within the grid's bounds
[[nodiscard]] std::optional<CoarseRoute> find_coarse_route(const PlanningGrid& grid,
                                                           const Eigen::Vector2d& start_map,
                                                           const Eigen::Vector2d& goal_map);

}  // namespace stillmap
