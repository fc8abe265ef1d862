#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/planning/coarse_route.hpp"
#include "core/planning/collision_checker.hpp"
#include "core/planning/path_planner.hpp"

namespace stillmap {

struct SearchSettings {
  PlannerKind planner = PlannerKind::rrt_connect;
  /// Limit of steps: curves checked and iterations of the planner. Does not depend on the machine.
  std::uint64_t max_steps = 0;
  std::uint32_t seed = 1;
  /// Polled; ends the search when true. May be empty.
  std::function<bool()> should_stop;
  /// Called with the cost of every better path. May be empty.
  std::function<void(double)> improved;
};

struct SearchResult {
  /// From a start to a goal, or without `reaches_goal` to the nearest pose reached; empty if there
  /// is none. The path is the curves between them.
  std::vector<PlanarPose> waypoints;
  bool reaches_goal = false;
  /// Steps used.
  std::uint64_t steps = 0;
};

/// Searches a path from one of the starts to one of the goals: rrt_connect returns the first that
/// it finds, the other planners the cheapest within their limits. NOT thread-safe: OMPL's seed is
/// global. @pre starts and goals are free; the goals share one position
[[nodiscard]] SearchResult search_path(const CollisionChecker& checker, PoseSampler& sampler,
                                       std::span<const PlanarPose> starts,
                                       std::span<const PlanarPose> goals,
                                       const SearchSettings& settings);

}  // namespace stillmap
