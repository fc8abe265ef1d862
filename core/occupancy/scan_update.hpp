#pragma once

#include <Eigen/Geometry>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/throttle_callback.hpp"
#include "core/occupancy/occupancy_config.hpp"
#include "core/occupancy/scan_update_options.hpp"
#include "core/occupancy/voxel_bricks.hpp"

namespace stillmap {

/// Gathers what a scan tells: the voxels of its stationary points, and, where it clears, those that
/// its rays pass within the clearing range, points of movable things included. One ray for each
/// cube of 2 x 2 x 2 voxels that rays end in. Points that are not finite, or outside the octree,
/// tell nothing; nor does a scan whose lidar is outside.
void compute_scan_update(const OccupancyConfig& config, const LabelledScan& scan,
                         const Eigen::Isometry3d& T_map_lidar, const ScanUpdateOptions& use,
                         VoxelBricks& bricks, const ThrottleCallback& throttle = {});

/// Whether a position, in voxels from the octree's corner, lies in the octree. False for NaN.
[[nodiscard]] bool in_octree(const Eigen::Vector3d& p_voxels);

}  // namespace stillmap
