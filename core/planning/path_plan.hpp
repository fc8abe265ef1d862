#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/traversability/traversability_view.hpp"
#include "core/traversability/path_check.hpp"

namespace stillmap {

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

}  // namespace stillmap
