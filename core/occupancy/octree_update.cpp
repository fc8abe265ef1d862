#include "core/occupancy/octree_update.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"
#include "core/occupancy/scan_update.hpp"

namespace stillmap {
namespace {

using octomap::OcTree;
using octomap::OcTreeNode;

/// Depth of the nodes that correspond to bricks: two levels above the voxels.
constexpr unsigned brick_depth = 14;

struct Child {
  OcTreeNode* node;
  bool is_new;
};

class BatchUpdate {
 public:
  BatchUpdate(OcTree& octree, const LogOddsSteps& steps) : octree_(octree), steps_(steps) {}

  void update(OcTreeNode& node, bool is_new, unsigned depth, std::span<const VoxelBrick> bricks) {
    if (!is_new && is_saturated_leaf(node, bricks)) return;
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
  /// Whether the node is a leaf that the updates do not change: clamped, and all in that direction.
  [[nodiscard]] bool is_saturated_leaf(const OcTreeNode& node,
                                       std::span<const VoxelBrick> bricks) const {
    if (octree_.nodeHasChildren(&node)) return false;
    std::uint64_t hits = 0;
    std::uint64_t misses = 0;
    for (const VoxelBrick& brick : bricks) {
      hits |= brick.hits;
      misses |= brick.misses;
    }
    return is_clamped(node, hits, misses);
  }

  [[nodiscard]] bool is_clamped(const OcTreeNode& leaf, std::uint64_t hits,
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
      if (is_leaf && is_clamped(*child.node, hits, misses)) continue;
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

  /// Expands a pruned leaf into its children.
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

/// OctoMap creates a root only while it reads: an encoded tree of one node (log-odds, no children).
void make_root(OcTree& octree) {
  std::istringstream root(std::string(sizeof(float) + 1, '\0'));
  octree.readData(root);
}

/// Index of the column at a coordinate; columns are counted from the octree's lowest corner.
std::int32_t column_at(double position_map, double resolution_m) {
  const double voxel = std::floor(position_map / resolution_m) + octree_origin;
  return static_cast<std::int32_t>(std::floor(voxel / OctreeColumn::side_voxels));
}

/// An octree that is filled node by node. OctoMap's deleteNode() would keep the inner nodes' arrays
/// of child pointers.
class OctreeCopy : public octomap::OcTree {
 public:
  using octomap::OcTree::OcTree;

  octomap::OcTreeNode* make_root() {
    size_changed = true;
    tree_size = 1;
    return root = new octomap::OcTreeNode();
  }
};

/// Ground plan of a node: voxels [x, x + side) by [y, y + side).
struct NodeArea {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t side = octree_side;

  [[nodiscard]] NodeArea child(unsigned index) const {
    const std::int32_t half = side / 2;
    return {x + ((index & 1U) != 0 ? half : 0), y + ((index & 2U) != 0 ? half : 0), half};
  }
};

/// Copies an octree without some columns.
class Pruner {
 public:
  Pruner(octomap::OcTree& from, OctreeCopy& to, const std::set<OctreeColumn>& without)
      : from_(from), to_(to), without_(without) {}

  void copy_all() {
    if (from_.getRoot() != nullptr && keeps(*from_.getRoot(), {})) {
      copy(*from_.getRoot(), *to_.make_root(), {});
    }
  }

 private:
  /// Number of evicted columns that overlap the area.
  [[nodiscard]] std::size_t evicted_in(const NodeArea& area) const {
    constexpr std::int32_t side = OctreeColumn::side_voxels;
    const OctreeColumn first{area.x / side, area.y / side};
    const OctreeColumn last{(area.x + area.side - 1) / side, (area.y + area.side - 1) / side};
    return static_cast<std::size_t>(
        std::ranges::count_if(without_, [&](const OctreeColumn& evicted) {
          return evicted.x >= first.x && evicted.x <= last.x && evicted.y >= first.y &&
                 evicted.y <= last.y;
        }));
  }

  [[nodiscard]] bool keeps(octomap::OcTreeNode& node, const NodeArea& area) const {
    if (area.side <= OctreeColumn::side_voxels) return evicted_in(area) == 0;
    if (!from_.nodeHasChildren(&node)) {
      const auto columns = static_cast<std::size_t>(area.side / OctreeColumn::side_voxels);
      return evicted_in(area) < columns * columns;
    }
    for (unsigned i = 0; i < 8; ++i) {
      if (from_.nodeChildExists(&node, i) && keeps(*from_.getNodeChild(&node, i), area.child(i))) {
        return true;
      }
    }
    return false;
  }

  void copy(octomap::OcTreeNode& from, octomap::OcTreeNode& to, const NodeArea& area) {
    to.copyData(from);
    const bool is_wide = area.side > OctreeColumn::side_voxels;
    // A leaf wider than a column is split where part of it is evicted.
    if (is_wide && !from_.nodeHasChildren(&from) && evicted_in(area) > 0) from_.expandNode(&from);
    if (!from_.nodeHasChildren(&from)) return;
    for (unsigned i = 0; i < 8; ++i) {
      if (!from_.nodeChildExists(&from, i)) continue;
      octomap::OcTreeNode& child = *from_.getNodeChild(&from, i);
      // A node no wider than a column is kept or evicted as a whole.
      if (is_wide && !keeps(child, area.child(i))) continue;
      copy(child, *to_.createNodeChild(&to, i), area.child(i));
    }
    to.updateOccupancyChildren();
  }

  octomap::OcTree& from_;
  OctreeCopy& to_;
  const std::set<OctreeColumn>& without_;
};

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

std::vector<OctreeColumn> columns_of(TileId id, double tile_size_m, double resolution_m) {
  // Half a voxel inside, so that a tile does not touch the column beyond its far edge.
  const double far_side_m = tile_size_m - 0.5 * resolution_m;
  const double x_map = id.x * tile_size_m;
  const double y_map = id.y * tile_size_m;
  const OctreeColumn first{column_at(x_map, resolution_m), column_at(y_map, resolution_m)};
  const OctreeColumn last{column_at(x_map + far_side_m, resolution_m),
                          column_at(y_map + far_side_m, resolution_m)};
  std::vector<OctreeColumn> columns;
  for (OctreeColumn at = first; at.x <= last.x; ++at.x) {
    for (at.y = first.y; at.y <= last.y; ++at.y) columns.push_back(at);
  }
  return columns;
}

ColumnTiles tiles_of(OctreeColumn column, const MapSnapshot& view, double resolution_m) {
  const auto corner_m = [&](std::int32_t at) {
    return (static_cast<double>(at) * OctreeColumn::side_voxels - octree_origin) * resolution_m;
  };
  const Eigen::AlignedBox3d box_map(
      Eigen::Vector3d(corner_m(column.x), corner_m(column.y), 0.0),
      Eigen::Vector3d(corner_m(column.x + 1), corner_m(column.y + 1), 0.0));
  ColumnTiles tiles;
  for (const auto& tile : tiles_in_range(view.tiles, tile_range(box_map, view.tile_size_m))) {
    const auto columns = columns_of(tile->info.id, view.tile_size_m, resolution_m);
    if (std::ranges::find(columns, column) == columns.end()) continue;
    if (is_non_resident(*tile)) {
      tiles.has_non_resident = true;
    } else {
      tiles.resident.push_back(tile);
    }
  }
  return tiles;
}

void evict_columns(octomap::OcTree& octree, const std::set<OctreeColumn>& columns) {
  OctreeCopy left(octree.getResolution());
  Pruner(octree, left, columns).copy_all();
  octree.swapContent(left);
}

}  // namespace stillmap
