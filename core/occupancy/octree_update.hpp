#pragma once

#include <span>

#include "core/occupancy/voxel_bricks.hpp"

namespace octomap {
class OcTree;
}

namespace stillmap {

/// What a hit and a miss add to a voxel's log-odds.
struct LogOddsSteps {
  float hit = 0.0F;
  float miss = 0.0F;
};

/// Updates all these voxels in one walk through the octree: an inner node is visited once, however
/// many voxels below it change. `bricks` are in the octree's order. The result is what OctoMap's
/// updateNode() makes of the voxels one by one.
void update_octree(octomap::OcTree& octree, std::span<const VoxelBrick> bricks,
                   const LogOddsSteps& steps);

}  // namespace stillmap
