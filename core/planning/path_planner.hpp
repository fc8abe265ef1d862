#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Available planners of OMPL.
enum class PlannerKind : std::uint8_t { rrt_connect, rrt_star, bit_star };
inline constexpr std::size_t planner_kind_count = 3;

[[nodiscard]] std::string_view name(PlannerKind kind);

/// Costs and limits of plan_path.
struct PlanningConfig {
  PlannerKind planner = PlannerKind::rrt_connect;
  /// Samples most poses around the coarse route instead of uniformly.
  bool route_guided = true;
  /// Additional cost of a metre over a cell of the highest cost.
  double cost_weight = 4.0;
  /// Cost of a metre in reverse, relative to one forwards; at least 1.
  double reverse_factor = 3.0;
  /// Limit of curves checked plus iterations of the planner.
  std::uint64_t max_steps = 60'000;
  /// Limit of searches with different seeds, as long as the best path costs much more than the
  /// coarse route.
  std::uint32_t max_attempts = 8;
  /// Attempts to shorten the path.
  int smoothing_attempts = 1000;
  /// Equal map, request, configuration and seed give the same path, unless `should_stop` ended the
  /// search.
  std::uint32_t seed = 1;
  /// Polled in all stages; when true, the best path so far is returned, if any. May be empty.
  std::function<bool()> should_stop;
  /// Called with the cost of every better path. May be empty.
  std::function<void(double)> improved;

  /// One line for each invalid value; empty when the configuration is valid.
  [[nodiscard]] std::string faults() const;
};

/// Start or goal of a path.
struct Goal {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// Counterclockwise from x; any heading if not set.
  std::optional<double> heading_rad;
  /// Of any part of the robot there, map frame [m]; unknown if not set. A start whose ground lies
  /// on another level, as that below a bridge, is refused.
  std::optional<double> height_m = std::nullopt;
};

enum class PlanStatus : std::uint8_t {
  found,
  /// `reason` names the invalid value and the valid ones.
  invalid_request,
  /// The robot collides at the start: see `conflict` and `nearby`. Or it is not on the ground that
  /// the map has there.
  start_blocked,
  /// As start_blocked, of the goal.
  goal_blocked,
  /// No path over known ground is wide enough; more steps would not help.
  no_path,
  /// The search ended before it found a path; there may be one. `poses` lead to the nearest pose
  /// reached, if any was before the stage that `reason` names.
  out_of_time,
};

[[nodiscard]] std::string_view name(PlanStatus status);

/// A pose of a planned path.
struct PlannedPose {
  PlanarPose pose;
  /// Height of the ground, map frame [m]; NaN where unknown.
  double height_m = std::numeric_limits<double>::quiet_NaN();
  /// Distance along the path [m].
  double along_m = 0.0;
  /// Whether the robot drives to it in reverse.
  bool is_reverse = false;
};

/// A path, or why there is none.
struct PathPlan {
  PlanStatus status = PlanStatus::found;
  std::string reason;
  /// At a blocked start or goal.
  std::optional<PathConflict> conflict;
  /// The free cell nearest to a blocked start or goal, if any.
  std::optional<NearestTraversable> nearby;

  /// From start to goal; free according to check_long_path.
  std::vector<PlannedPose> poses;
  double length_m = 0.0;
  /// Part of it in reverse [m].
  double reverse_m = 0.0;
  /// Part of it on inferred ground [m].
  double inferred_m = 0.0;
  /// Smallest distance from the footprint to a lethal cell [m], at most clearance_limit_m.
  double clearance_m = 0.0;
  /// Metres times the cost factors of cell (at least 1) and direction.
  double cost = 0.0;
  /// Length of the coarse route [m].
  double route_m = 0.0;
  /// Steps used by the search.
  std::uint64_t steps = 0;
  std::uint64_t map_version = 0;

  [[nodiscard]] bool is_found() const { return status == PlanStatus::found; }
  /// As check_path takes them.
  [[nodiscard]] std::vector<PlanarPose> path_map() const;
};

/// Plans a path for the view's robot: the whole footprint stays on free cells (or unknown ones, if
/// the profile allows them) at every pose, and curves keep to the minimum turning radius. A coarse
/// route over the cells detects early that there is no path; OMPL then searches around it.
/// check_long_path verifies every path that is returned.
///
/// NOT thread-safe: OMPL's seed is global. Throws std::invalid_argument for a configuration with
/// faults.
[[nodiscard]] PathPlan plan_path(const TraversabilityView& view, const Goal& from, const Goal& to,
                                 const PlanningConfig& config = {});

}  // namespace stillmap
