#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "clients/terminal/json.hpp"
#include "core/planning/path_planner.hpp"

namespace stillmap::cli {

/// A plan and how long it took.
struct TimedPlan {
  PathPlan plan;
  /// Update of the traversability map [ms].
  double traversability_ms = 0.0;
  double plan_ms = 0.0;
  /// Until the search had its first path [ms]; only of planners that report it.
  std::optional<double> first_ms;
  /// Why it replaces the previous plan; empty for the first one.
  std::string cause;
};

/// `with_poses`: with every pose of the path.
[[nodiscard]] Json to_json(const TimedPlan& timed, bool with_poses);

/// For people, with the poses of the path some metres apart.
[[nodiscard]] std::string describe(const TimedPlan& timed);

/// One line, for --follow.
[[nodiscard]] std::string one_line(const TimedPlan& timed);

/// Writes the path: all of it to FILE.json, or one pose a line to FILE.csv; what the file held
/// stays until the new path is whole. Throws std::invalid_argument for another ending,
/// std::runtime_error when it cannot be written.
void write_plan(const std::filesystem::path& file, const TimedPlan& timed);

/// Throws std::invalid_argument when write_plan would refuse the name.
void check_plan_file(const std::filesystem::path& file);

}  // namespace stillmap::cli
