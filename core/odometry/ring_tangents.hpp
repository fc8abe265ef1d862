#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// Of every point of the scan, the direction in which its surface goes on along its ring, of length
/// 1 in the lidar's frame; zero where it does not go straight on to both sides, and of those that
/// are not `chosen`, and where what is 0.3 m away lies more than `max_steps` points on. The surface
/// contains it, whatever the points of other rings and scans make of it. `scan.ring` must be known.
/// Where eight points lie nearer than that, other rings are near, too, and mostly need none.
[[nodiscard]] std::vector<Eigen::Vector3f> ring_tangents(const Scan& scan,
                                                         std::span<const std::uint32_t> chosen,
                                                         std::size_t max_steps = 8);

}  // namespace stillmap
