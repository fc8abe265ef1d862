#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>

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

}  // namespace stillmap
