#include "core/occupancy/octree_parts.hpp"

#include <octomap/OcTree.h>

#include <bit>

namespace stillmap {
namespace {

using octomap::OcTree;
using octomap::OcTreeNode;

constexpr unsigned tree_depth = 16;

void add_parts(const OcTree& octree, const OcTreeNode& node, const OctreePart& place,
               const VoxelKey& first, const VoxelKey& last, OctreeParts& found) {
  const VoxelKey end = place.corner.array() + (place.side - 1);
  const bool is_apart =
      (end.array() < first.array()).any() || (place.corner.array() > last.array()).any();
  if (is_apart) return;
  if (place.side <= OctreePart::usual_side || !octree.nodeHasChildren(&node)) {
    found.parts.push_back(place);
    return;
  }
  ++found.nodes_above;
  for (unsigned i = 0; i < 8; ++i) {
    if (!octree.nodeChildExists(&node, i)) continue;
    add_parts(octree, *octree.getNodeChild(&node, i), place.child(i), first, last, found);
  }
}

}  // namespace

OctreePart OctreePart::child(unsigned i) const {
  const std::int32_t half = side / 2;
  const VoxelKey offset((i & 1U) != 0 ? half : 0, (i & 2U) != 0 ? half : 0,
                        (i & 4U) != 0 ? half : 0);
  return {.corner = corner + offset, .side = half};
}

bool OctreePart::contains(const OctreePart& other) const {
  const VoxelKey end = corner.array() + side;
  return (other.corner.array() >= corner.array()).all() &&
         (other.corner.array() < end.array()).all();
}

OctreeParts parts_of(const OcTree& octree, const VoxelKey& first, const VoxelKey& last) {
  OctreeParts found;
  if (const OcTreeNode* const root = octree.getRoot(); root != nullptr) {
    add_parts(octree, *root, OctreePart(), first, last, found);
  }
  return found;
}

const OcTreeNode* node_of(const OcTree& octree, const OctreePart& part) {
  const unsigned depth =
      tree_depth + 1 - static_cast<unsigned>(std::bit_width(static_cast<unsigned>(part.side)));
  // OctoMap takes depth 0 for that of a voxel.
  if (depth == 0) return octree.getRoot();
  const octomap::OcTreeKey key(static_cast<octomap::key_type>(part.corner.x()),
                               static_cast<octomap::key_type>(part.corner.y()),
                               static_cast<octomap::key_type>(part.corner.z()));
  return octree.search(key, depth);
}

}  // namespace stillmap
