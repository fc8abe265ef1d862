#pragma once

#include <filesystem>
#include <span>

#include "core/lidar/trajectory.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

struct TraversabilityPictureOptions {
  /// Longest side of the map on the picture, without the legend [px].
  int max_side_px = 1800;
  /// Drawn over the area: where the lidar went, and a path that a planner found; map frame [m].
  Trajectory trajectory;
  std::span<const PlanarPose> path_map;
};

/// Writes a PNG of the area from above, x to the right and y up: free cells green (paler with
/// their cost, bluish where inferred), lethal ones in a colour for each reason, unknown ones dark;
/// legend with shares and scale bar. An empty area gives a picture that says so. Throws
/// std::runtime_error naming the file when it cannot be written.
void write_traversability_picture(const std::filesystem::path& file, const TraversabilityView& view,
                                  const TraversabilityPictureOptions& options = {});

}  // namespace stillmap
