#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/odometry/ray_density.hpp"

namespace stillmap {

/// Of every point whether it is up to 20 m away and by itself (1): hardly any of the rays beside
/// its own ends near it. Such are flakes, drops and dust anywhere, close above the ground, too; but
/// also what is thinner than rays are apart, so that it takes weather to ask: empty where fewer
/// than this share of `first`, points that may be in the air, are. `points_lidar` are in the
/// lidar's frame [m].
[[nodiscard]] std::vector<std::uint8_t> isolated_points(
    std::span<const Eigen::Vector3f> points_lidar, const RayDensity& rays,
    const std::vector<bool>& first, double min_share);

}  // namespace stillmap
