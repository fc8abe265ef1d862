#pragma once

#include <string>
#include <vector>

#include "core/traversability/path_check.hpp"

namespace stillmap {

/// Can this robot follow this path?
struct PathQuery {
  /// Name of the robot profile, for a server that keeps several.
  std::string profile;
  /// Map frame [m].
  std::vector<Eigen::Vector2d> positions_map;
  /// One a position: the robot turns evenly from one to the next. Or none: it drives straight ahead
  /// from position to position and turns on the spot.
  std::vector<double> headings_rad;
};

/// Checks the path, whatever profile it names; a conflict's `segment` counts the positions. At most
/// `max_path_poses` positions, half as many without headings; without, there must be two.
[[nodiscard]] PathCheck check_path(const TraversabilityView& view, const PathQuery& query);

}  // namespace stillmap
