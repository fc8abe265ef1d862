#pragma once

#include <cstdint>
#include <optional>
#include <random>
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

/// Draws poses for the search. City streets are a small part of the space of all poses: most are
/// drawn beside a coarse route and along it, some with any heading near its ends (where a car may
/// have to turn round), and some from all places where the robot may stand, so that nothing is
/// out of reach.
class PoseSampler {
 public:
  /// Without `is_guided`, only the last kind. The grid must outlive the sampler.
  PoseSampler(const PlanningGrid& grid, const CoarseRoute& route, bool is_guided,
              std::uint32_t seed);

  [[nodiscard]] PlanarPose draw();

 private:
  [[nodiscard]] PlanarPose draw_beside_route();
  [[nodiscard]] PlanarPose draw_near_an_end();
  [[nodiscard]] PlanarPose draw_anywhere();
  [[nodiscard]] double uniform(double low, double high);
  [[nodiscard]] double normal(double deviation);

  const PlanningGrid& grid_;
  /// Headings along the route.
  std::vector<PlanarPose> route_;
  bool is_guided_;
  // Plain engine, own distributions: those of the standard library differ between its makers.
  std::mt19937_64 random_;
};

}  // namespace stillmap
