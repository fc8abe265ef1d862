#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/planning/path_plan.hpp"
#include "core/planning/planning_config.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// A place to plan from or to.
struct Goal {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// From x towards y; without one, any heading will do.
  std::optional<double> heading_rad;
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
