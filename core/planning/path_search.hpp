#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/planning/coarse_route.hpp"
#include "core/planning/collision_checker.hpp"
#include "core/planning/path_planner.hpp"

namespace stillmap {

struct SearchResult {
  /// From a start to a goal, or without `reaches_goal` to the nearest pose reached; empty if there
  /// is none. The path is the curves between them.
  std::vector<PlanarPose> waypoints;
  bool reaches_goal = false;
  /// Steps used.
  std::uint64_t steps = 0;
};

/// Searches a path from one of the starts to one of the goals: rrt_connect returns the first that
/// it finds, the other planners the cheapest within `config.max_steps`. One search, with
/// `config.seed`. NOT thread-safe: OMPL's seed is global.
/// @pre starts and goals are free; the goals share one position
[[nodiscard]] SearchResult search_path(const CollisionChecker& checker, PoseSampler& sampler,
                                       std::span<const PlanarPose> starts,
                                       std::span<const PlanarPose> goals,
                                       const PlanningConfig& config);

}  // namespace stillmap
