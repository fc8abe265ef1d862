#pragma once

#include <Eigen/Geometry>

#include "core/lidar/labelled_scan.hpp"
#include "core/occupancy/occupancy_config.hpp"
#include "core/occupancy/scan_update_options.hpp"
#include "core/occupancy/voxel_bricks.hpp"
#include "core/throttle_callback.hpp"

namespace stillmap {

/// Gathers what a scan tells: the voxels of its stationary points, and, where it clears, those that
/// its rays pass within the clearing range, points of movable things included. One ray for each
/// cube of 2 x 2 x 2 voxels that rays end in. Points that are not finite, or outside the octree,
/// tell nothing; nor does a scan whose lidar is outside.
void gather_scan(const OccupancyConfig& config, const LabelledScan& scan,
                 const Eigen::Isometry3d& T_map_lidar, const ScanUse& use, VoxelBricks& bricks,
                 const Pause& pause = {});

/// Whether a position, in voxels from the octree's corner, lies in the octree. False for NaN.
[[nodiscard]] bool in_octree(const Eigen::Vector3d& p_voxels);

}  // namespace stillmap
