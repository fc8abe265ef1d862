#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/lidar/range_image.hpp"

namespace stillmap {

/// Angle of the seen surface above the horizontal [rad], one entry a pixel, along the pixel's
/// column: atan2(z_above - z_below, d_above - d_below), where d is the horizontal distance of the
/// nearest seen pixels within three rows above and below, or of the pixel itself where there is
/// none. 0 on level ground, pi/2 on a wall, more under an overhang; 0 in empty pixels and where the
/// column shows nothing else nearby. What tells ground from walls holds for any lidar at any
/// height.
///
/// `points_lidar` are those of the image, z upwards.
[[nodiscard]] std::vector<float> surface_slope_rad(const RangeImage& image,
                                                   std::span<const Eigen::Vector3f> points_lidar);

}  // namespace stillmap
