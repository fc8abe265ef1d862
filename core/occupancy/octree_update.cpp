#include "core/occupancy/octree_update.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <sstream>

namespace stillmap {
namespace {

using octomap::OcTree;
using octomap::OcTreeNode;

/// Depth of the nodes that are bricks: two levels above the voxels.
constexpr unsigned brick_depth = 14;

struct Child {
  OcTreeNode* node;
  bool is_new;
};

class BatchUpdate {
 public:
  BatchUpdate(OcTree& octree, const LogOddsSteps& steps) : octree_(octree), steps_(steps) {}

  void update(OcTreeNode& node, bool is_new, unsigned depth, std::span<const VoxelBrick> bricks) {
    if (!is_new && stays_as_it_is(node, bricks)) return;
    open(node, is_new);
    if (depth == brick_depth) {
      update_octants(node, bricks.front());
    } else {
      const unsigned shift = 3 * (brick_depth - 1 - depth);
      while (!bricks.empty()) {
        const std::uint64_t part = bricks.front().order >> shift;
        const auto end = std::ranges::find_if(
            bricks, [&](const VoxelBrick& brick) { return brick.order >> shift != part; });
        const auto count = static_cast<std::size_t>(end - bricks.begin());
        const Child child = child_of(node, static_cast<unsigned>(part & 7U));
        update(*child.node, child.is_new, depth + 1, bricks.first(count));
        bricks = bricks.subspan(count);
      }
    }
    close(node);
  }

 private:
  /// A leaf that stands for all its voxels and is as sure as it can be.
  [[nodiscard]] bool stays_as_it_is(const OcTreeNode& node,
                                    std::span<const VoxelBrick> bricks) const {
    if (octree_.nodeHasChildren(&node)) return false;
    std::uint64_t hits = 0;
    std::uint64_t misses = 0;
    for (const VoxelBrick& brick : bricks) {
      hits |= brick.hits;
      misses |= brick.misses;
    }
    return is_sure(node, hits, misses);
  }

  [[nodiscard]] bool is_sure(const OcTreeNode& leaf, std::uint64_t hits,
                             std::uint64_t misses) const {
    if (hits == 0) return leaf.getLogOdds() <= octree_.getClampingThresMinLog();
    return misses == 0 && leaf.getLogOdds() >= octree_.getClampingThresMaxLog();
  }

  void update_octants(OcTreeNode& node, const VoxelBrick& brick) {
    for (unsigned octant = 0; octant < 8; ++octant) {
      const auto hits = static_cast<unsigned>(brick.hits >> (8U * octant) & 0xFFU);
      const auto misses = static_cast<unsigned>(brick.misses >> (8U * octant) & 0xFFU);
      if ((hits | misses) == 0) continue;
      const Child child = child_of(node, octant);
      const bool is_leaf = !child.is_new && !octree_.nodeHasChildren(child.node);
      if (is_leaf && is_sure(*child.node, hits, misses)) continue;
      open(*child.node, child.is_new);
      update_voxels(*child.node, hits, misses);
      close(*child.node);
    }
  }

  void update_voxels(OcTreeNode& parent, unsigned hits, unsigned misses) {
    for (unsigned i = 0; i < 8; ++i) {
      const bool hit = (hits >> i & 1U) != 0;
      if (!hit && (misses >> i & 1U) == 0) continue;
      octree_.updateNodeLogOdds(child_of(parent, i).node, hit ? steps_.hit : steps_.miss);
    }
  }

  /// Gives a leaf that stands for all its voxels children of its own.
  void open(OcTreeNode& node, bool is_new) {
    if (!is_new && !octree_.nodeHasChildren(&node)) octree_.expandNode(&node);
  }

  void close(OcTreeNode& node) {
    if (!octree_.pruneNode(&node)) node.updateOccupancyChildren();
  }

  [[nodiscard]] Child child_of(OcTreeNode& node, unsigned i) {
    if (octree_.nodeChildExists(&node, i)) return {octree_.getNodeChild(&node, i), false};
    return {octree_.createNodeChild(&node, i), true};
  }

  OcTree& octree_;
  LogOddsSteps steps_;
};

/// Only OctoMap itself can: here it reads an octree of nothing else, log-odds and no children.
void make_root(OcTree& octree) {
  std::istringstream root(std::string(sizeof(float) + 1, '\0'));
  octree.readData(root);
}

}  // namespace

void update_octree(OcTree& octree, std::span<const VoxelBrick> bricks, const LogOddsSteps& steps) {
  std::vector<VoxelBrick> touched;
  for (const VoxelBrick& brick : bricks) {
    if ((brick.hits | brick.misses) != 0) touched.push_back(brick);
  }
  if (touched.empty()) return;
  const bool is_new = octree.getRoot() == nullptr;
  if (is_new) make_root(octree);
  BatchUpdate(octree, steps).update(*octree.getRoot(), is_new, 0, touched);
}

}  // namespace stillmap
