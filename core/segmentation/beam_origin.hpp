#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace stillmap {

/// How high above the origin of their frame the points of a scan were measured from [m], where that
/// origin lies on the ground, as a robot's (base_link) does: an image is to be one of the lidar's
/// surroundings, in which every beam has its row. From there the elevations of what stands up are
/// few, and from anywhere else many; where none stands out (several lidars in one cloud) it is
/// `usual_height_m`. Nothing for points in the lidar's own frame, on a low robot, too.
[[nodiscard]] std::optional<double> lidar_height_over_origin(
    std::span<const Eigen::Vector3f> points, double usual_height_m);

}  // namespace stillmap
