#pragma once

#include <cstdint>
#include <vector>

#include "core/occupancy/octree_grid.hpp"

namespace octomap {
class OcTree;
class OcTreeNode;
}  // namespace octomap

namespace stillmap {

/// A cube of the octree that is one node's. Long reading goes from part to part, so that a writer
/// may have the octree in between: parts are found anew by where they lie, not by their nodes.
struct OctreePart {
  /// Lowest voxel.
  VoxelKey corner = VoxelKey::Zero();
  /// Voxels along an edge: of the part, and of most of them.
  std::int32_t side = octree_side;
  /// A millisecond's work at most, if all of its voxels are known.
  static constexpr std::int32_t usual_side = 32;

  friend bool operator==(const OctreePart& a, const OctreePart& b) {
    return a.corner == b.corner && a.side == b.side;
  }
  /// Its child `i` of the octree's eight.
  [[nodiscard]] OctreePart child(unsigned i) const;
  [[nodiscard]] bool contains(const OctreePart& other) const;
};

/// What the octree has between these voxels, both included, in its order: nodes of the usual side,
/// and larger leaves.
struct OctreeParts {
  std::vector<OctreePart> parts;
  /// Nodes above them that were looked at.
  std::size_t nodes_above = 0;
};
[[nodiscard]] OctreeParts parts_of(const octomap::OcTree& octree, const VoxelKey& first,
                                   const VoxelKey& last);

/// The part's node as the octree is now, or the leaf that it lies in; null where it is unknown.
[[nodiscard]] const octomap::OcTreeNode* node_of(const octomap::OcTree& octree,
                                                 const OctreePart& part);

}  // namespace stillmap
