#pragma once

#include <Eigen/Geometry>
#include <opencv2/core/types.hpp>

#include "core/map/tile.hpp"

namespace stillmap {

/// Where the map frame lies on a picture: x to the right, y up.
struct PictureFrame {
  /// Map position of the picture's lower left corner [m].
  Eigen::Vector2d corner_map = Eigen::Vector2d::Zero();
  double px_per_m = 1.0;
  cv::Size size;

  [[nodiscard]] cv::Point2d pixel(const Eigen::Vector2d& p_map) const {
    const Eigen::Vector2d p = (p_map - corner_map) * px_per_m;
    return {p.x(), size.height - p.y()};
  }
};

/// Round all voxels, in plan; empty for an empty map. Map frame [m].
[[nodiscard]] Eigen::AlignedBox2d xy_bounds(const MapSnapshot& view);

/// A picture with this box (map frame [m], not empty) in its middle, with a margin; its longest
/// side about `max_side_px`, and wide enough for a legend.
[[nodiscard]] PictureFrame fit_frame(const Eigen::AlignedBox2d& box_map, int max_side_px);

}  // namespace stillmap
