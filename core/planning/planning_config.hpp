#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/planning/path_search.hpp"

namespace stillmap {

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

}  // namespace stillmap
