#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "core/planning/planning_grid.hpp"

namespace stillmap {

/// Route of a disc with the robot's inscribed radius. Without one the robot has no path; with one,
/// the robot may still be too long for it or its turning radius too large.
struct CoarseRoute {
  /// From the start to the goal, map frame [m], about `step_m` apart.
  std::vector<Eigen::Vector2d> points_map;
  /// Edge of the search's squares, at least two cells of the map [m].
  double step_m = 0.0;
  double length_m = 0.0;
  /// Metres times cost factor of the cells: nearly a lower bound of a path's cost.
  double cost = 0.0;
};

/// The cheapest route over squares of at least 0.4 m, by A*; nothing if the goal cannot be reached.
/// Throws PlanningStopped when `should_stop`, which may be empty, is true meanwhile.
/// @pre both positions are within the grid's bounds
[[nodiscard]] std::optional<CoarseRoute> find_coarse_route(
    const PlanningGrid& grid, const Eigen::Vector2d& start_map, const Eigen::Vector2d& goal_map,
    const std::function<bool()>& should_stop = {});

/// Samples poses for the search. Free space is a small part of all poses of a city, so most samples
/// are drawn around the coarse route with headings along it, some near its ends at any heading
/// (where a car may have to turn), and some uniformly, so that every pose can be reached.
class PoseSampler {
 public:
  /// Without `is_guided`, samples are uniform. The grid must outlive the sampler.
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
  /// With headings along the route.
  std::vector<PlanarPose> route_;
  bool is_guided_;
  // Own distributions: those of the standard library are implementation-defined.
  std::mt19937_64 random_;
};

}  // namespace stillmap
