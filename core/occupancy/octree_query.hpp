#pragma once

#include <cstddef>

#include "core/occupancy/occupancy_query.hpp"

namespace octomap {
class OcTree;
}

namespace stillmap {

// Positions are in the map frame [m]. What cannot be asked for (not finite, outside the octree)
// comes back with a fault.

[[nodiscard]] PointOccupancy query_point(const octomap::OcTree& octree,
                                         const Eigen::Vector3d& p_map);

/// At most `max_voxels` occupied voxels are listed; all are counted.
[[nodiscard]] BoxOccupancy query_box(const octomap::OcTree& octree,
                                     const Eigen::AlignedBox3d& box_map, std::size_t max_voxels);

[[nodiscard]] RayOccupancy cast_ray(const octomap::OcTree& octree, const RayQuery& ray);

}  // namespace stillmap
