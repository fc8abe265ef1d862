#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/planning/coarse_route.hpp"
#include "core/planning/collision_checker.hpp"
#include "core/planning/planning_config.hpp"

namespace stillmap {

struct FoundPath {
  std::vector<PathPoint> poses;
  /// Else it leads to the place nearest to the goal that was reached.
  bool reaches_goal = false;
};

/// The cheapest of some searches with different seeds, smoothed: the first path that a search finds
/// may drive half the way backwards. Stops when a path costs about as much as the coarse route.
/// Adds the steps that it took to `steps`.
[[nodiscard]] std::optional<FoundPath> find_best_path(
    const CollisionChecker& checker, const CoarseRoute& route, std::span<const PlanarPose> starts,
    std::span<const PlanarPose> goals, const PlanningConfig& config, std::uint64_t& steps);

}  // namespace stillmap
