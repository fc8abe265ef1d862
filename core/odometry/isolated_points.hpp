#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/odometry/ray_density.hpp"

namespace stillmap {

/// Of every point whether it is up to 20 m away and by itself: hardly any of the rays beside its
/// own ends near it. Such are flakes, drops and dust anywhere, close above the ground, too; but
/// also what is thinner than rays are apart, so that it takes weather to ask. `points_lidar` are in
/// the lidar's frame [m].
[[nodiscard]] std::vector<bool> isolated_points(std::span<const Eigen::Vector3f> points_lidar,
                                                const RayDensity& rays);

}  // namespace stillmap
