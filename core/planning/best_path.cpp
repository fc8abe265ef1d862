#include "core/planning/best_path.hpp"

#include <utility>

#include "core/planning/path_smoother.hpp"

namespace stillmap {
namespace {

/// Near what the coarse route costs, with some way to turn round at both ends.
bool is_good(const FoundPath& path, const CoarseRoute& route, const RobotProfile& profile) {
  constexpr double factor = 1.1;
  constexpr double turns_in_radii = 4.0;
  return path.reaches_goal &&
         path.poses.back().cost <
             factor * route.cost + turns_in_radii * profile.min_turning_radius_m;
}

bool is_better(const FoundPath& a, const FoundPath& b) {
  if (a.reaches_goal != b.reaches_goal) return a.reaches_goal;
  return a.poses.back().cost < b.poses.back().cost;
}

std::vector<PathPoint> smoothed(const CollisionChecker& checker, std::vector<PathPoint> path,
                                std::span<const PlanarPose> goals, int tries,
                                const PlanningConfig& config) {
  return smooth_path(checker, std::move(path), goals, tries, config.seed, config.should_stop);
}

std::optional<FoundPath> attempt(const CollisionChecker& checker, const CoarseRoute& route,
                                 std::span<const PlanarPose> starts,
                                 std::span<const PlanarPose> goals, const PlanningConfig& config,
                                 std::uint32_t seed, std::uint64_t& steps) {
  PoseSampler sampler(checker.grid(), route, config.route_guided, seed);
  const SearchResult found = search_path(checker, sampler, starts, goals,
                                         {.planner = config.planner,
                                          .max_steps = config.max_steps - steps,
                                          .seed = seed,
                                          .should_stop = config.should_stop,
                                          .improved = config.improved});
  steps += found.steps;
  if (found.waypoints.empty()) return std::nullopt;
  auto poses = connect_waypoints(checker, found.waypoints);
  if (!poses) return std::nullopt;
  // Enough to compare it with others.
  const int tries = found.reaches_goal ? config.smoothing_attempts / 4 : 0;
  return FoundPath{smoothed(checker, *std::move(poses), goals, tries, config), found.reaches_goal};
}

}  // namespace

std::optional<FoundPath> find_best_path(const CollisionChecker& checker, const CoarseRoute& route,
                                        std::span<const PlanarPose> starts,
                                        std::span<const PlanarPose> goals,
                                        const PlanningConfig& config, std::uint64_t& steps) {
  std::optional<FoundPath> best;
  for (std::uint32_t i = 0; i < config.max_attempts && steps < config.max_steps; ++i) {
    auto path = attempt(checker, route, starts, goals, config, config.seed + i, steps);
    if (path && (!best || is_better(*path, *best))) best = std::move(path);
    if (best && is_good(*best, route, checker.grid().profile())) break;
    if (config.should_stop && config.should_stop()) break;
  }
  if (best && best->reaches_goal) {
    best->poses =
        smoothed(checker, std::move(best->poses), goals, config.smoothing_attempts, config);
  }
  return best;
}

}  // namespace stillmap
