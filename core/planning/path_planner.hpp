#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// OMPL's planners that can be chosen.
enum class PlannerKind : std::uint8_t { rrt_connect, rrt_star, bit_star };
inline constexpr std::size_t planner_kind_count = 3;

[[nodiscard]] std::string_view name(PlannerKind kind);

/// How hard plan_path looks for a path, and what a path costs.
struct PlanningConfig {
  PlannerKind planner = PlannerKind::rrt_connect;
  /// Draw most poses beside the coarse route instead of everywhere.
  bool route_guided = true;
  /// A metre over a cell of the highest cost is as long as this many metres more.
  double cost_weight = 4.0;
  /// A metre backwards is as long as this many forwards; 1 or more.
  double reverse_factor = 3.0;
  /// Curves looked at and rounds of the planner, at most.
  std::uint64_t max_steps = 60'000;
  /// Searches with other seeds, at most, as long as the best path costs much more than the coarse
  /// route.
  std::uint32_t max_attempts = 8;
  /// Attempts to shorten the path that was found.
  int smoothing_attempts = 1000;
  /// Same map, question, configuration and seed: same path, unless `should_stop` cut it short.
  std::uint32_t seed = 1;
  /// Asked all the time; when true, the best path so far is taken. May be empty.
  std::function<bool()> should_stop;
  /// Told the cost of every better path as the search finds it. May be empty.
  std::function<void(double)> improved;

  /// Every fault in words, one a line; empty when it can be used.
  [[nodiscard]] std::string faults() const;
};

/// A place to plan from or to.
struct Goal {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// From x towards y; without one, any heading will do.
  std::optional<double> heading_rad;
};

enum class PlanStatus : std::uint8_t {
  found,
  /// The question makes no sense: `reason` names the value and what would do.
  invalid_request,
  /// The robot cannot stand at the start; `conflict` says why, `nearby` where it could.
  start_blocked,
  /// As start_blocked, of the goal.
  goal_blocked,
  /// No way over known ground is wide enough: more time would not help.
  no_path,
  /// There may be a way; the search ended before one was found that the robot can drive. `poses`
  /// is the way to the nearest place reached.
  out_of_time,
};

[[nodiscard]] std::string_view name(PlanStatus status);

/// A pose of a planned path.
struct PlannedPose {
  PlanarPose pose;
  /// Of the ground, map frame [m]; 0 where nobody knows it.
  double height_m = 0.0;
  /// Way from the start [m].
  double along_m = 0.0;
  /// The robot comes here driving backwards.
  bool is_reverse = false;
};

/// A path for a robot, or why there is none.
struct PathPlan {
  PlanStatus status = PlanStatus::found;
  std::string reason;
  /// Of a blocked start or goal.
  std::optional<PathConflict> conflict;
  /// The nearest free place, when start or goal is blocked and there is one.
  std::optional<NearestTraversable> nearby;

  /// From start to goal; check_path says of them that they are free.
  std::vector<PlannedPose> poses;
  double length_m = 0.0;
  /// Part of it that is driven backwards [m].
  double reverse_m = 0.0;
  /// Part of it on inferred ground [m].
  double inferred_m = 0.0;
  /// Smallest distance from the footprint to something lethal [m], at most clearance_limit_m.
  double clearance_m = 0.0;
  /// Metres, each times the cost of its cell (1 and more) and of its direction.
  double cost = 0.0;
  /// Of the coarse route that guided the search [m].
  double route_m = 0.0;
  /// Steps of the search.
  std::uint64_t steps = 0;
  std::uint64_t map_version = 0;

  [[nodiscard]] bool is_found() const { return status == PlanStatus::found; }
  /// As check_path takes them.
  [[nodiscard]] std::vector<PlanarPose> path_map() const;
};

/// A path of the view's robot from one place to another: over free cells, or unknown ones where the
/// profile allows it, with its whole footprint at every pose, and no tighter than its turning
/// radius. The coarse route over cells tells at once when there is no way; OMPL finds the path that
/// the robot can drive. A path is looked at by check_path before it is given.
///
/// Not to be called by two threads at once: OMPL's seed is global.
/// Throws std::invalid_argument for a configuration with faults.
[[nodiscard]] PathPlan plan_path(const TraversabilityView& view, const Goal& from, const Goal& to,
                                 const PlanningConfig& config = {});

}  // namespace stillmap
