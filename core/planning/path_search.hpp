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
  /// The search ends after so many steps: curves looked at and rounds of the planner. The same on
  /// every machine.
  std::uint64_t max_steps = 0;
  std::uint32_t seed = 1;
  /// Asked all the time, ends the search when true; may be empty.
  std::function<bool()> should_stop;
  /// Told the cost of every better path; may be empty.
  std::function<void(double)> improved;
};

struct SearchResult {
  /// From a start to a goal, or without `reaches_goal` to the nearest place found; empty when there
  /// is none. The curves between them are the path.
  std::vector<PlanarPose> waypoints;
  bool reaches_goal = false;
  /// Steps that it took.
  std::uint64_t steps = 0;
};

/// A path from one of the starts to one of the goals, all of which are free: the first one found by
/// rrt_connect, the cheapest one found by the others, which use up their limits. The goals are one
/// place with several headings. One search at a time in a process: OMPL's seed is global.
[[nodiscard]] SearchResult search_path(const CollisionChecker& checker, PoseSampler& sampler,
                                       std::span<const PlanarPose> starts,
                                       std::span<const PlanarPose> goals,
                                       const SearchSettings& settings);

}  // namespace stillmap
