#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "core/lidar/trajectory.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

struct MapPictureOptions {
  /// Longest side of the map on the picture, without the legend [px].
  int max_side_px = 1800;
  /// Drawn beside the estimate; in the map frame [m].
  std::optional<Trajectory> truth;
  /// Joins poses of the estimate that were taken at one place, as a pose graph has them: numbers of
  /// poses.
  std::vector<std::pair<std::size_t, std::size_t>> closures;
  /// Outline of a query; map frame [m], infinite faces end at the picture's edge.
  std::optional<Eigen::AlignedBox3d> query_box_map;
  /// The estimate is no drive, but places found each by itself, of so many that were looked for: a
  /// mark each, with its heading, and no line.
  std::optional<std::size_t> looked_for;
};

/// Writes a PNG of the map from above, x to the right and y up: classes in SemanticKITTI's colours
/// (voxels without a class by their height above the ground), relief as brightness, the trajectory
/// from its start (ring) to its end (disc), scale bar and legend. An empty map gives a picture that
/// says so. Throws std::runtime_error naming the file when it cannot be written.
void write_map_picture(const std::filesystem::path& file, const MapSnapshot& view,
                       const Trajectory& estimate, const MapPictureOptions& options = {});

}  // namespace stillmap
