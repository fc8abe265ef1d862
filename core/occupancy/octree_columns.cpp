#include "core/occupancy/octree_columns.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>

#include "core/map/tile_store.hpp"
#include "core/occupancy/voxel_bricks.hpp"

namespace stillmap {
namespace {

/// Columns begin at the octree's corner.
std::int32_t column_at(double position_map, double resolution_m) {
  const double voxel = std::floor(position_map / resolution_m) + octree_origin;
  return static_cast<std::int32_t>(std::floor(voxel / OctreeColumn::side_voxels));
}

/// An octree to be filled node by node. (OctoMap's deleteNode() leaves what inner nodes point
/// with.)
class OctreeCopy : public octomap::OcTree {
 public:
  using octomap::OcTree::OcTree;

  octomap::OcTreeNode* make_root() {
    size_changed = true;
    tree_size = 1;
    return root = new octomap::OcTreeNode();
  }
};

/// A node's cube in plan: voxels [x, x + side) by [y, y + side).
struct NodeArea {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t side = octree_side;

  [[nodiscard]] NodeArea child(unsigned index) const {
    const std::int32_t half = side / 2;
    return {x + ((index & 1U) != 0 ? half : 0), y + ((index & 2U) != 0 ? half : 0), half};
  }
};

/// Copies a tree without some columns.
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
  /// How many of the columns that the area lies in, or that lie in it, are to go.
  [[nodiscard]] std::size_t gone_in(const NodeArea& area) const {
    constexpr std::int32_t side = OctreeColumn::side_voxels;
    const OctreeColumn first{area.x / side, area.y / side};
    const OctreeColumn last{(area.x + area.side - 1) / side, (area.y + area.side - 1) / side};
    return static_cast<std::size_t>(std::ranges::count_if(without_, [&](const OctreeColumn& gone) {
      return gone.x >= first.x && gone.x <= last.x && gone.y >= first.y && gone.y <= last.y;
    }));
  }

  [[nodiscard]] bool keeps(octomap::OcTreeNode& node, const NodeArea& area) const {
    if (area.side <= OctreeColumn::side_voxels) return gone_in(area) == 0;
    if (!from_.nodeHasChildren(&node)) {
      const auto columns = static_cast<std::size_t>(area.side / OctreeColumn::side_voxels);
      return gone_in(area) < columns * columns;
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
    // A leaf that is wider than a column is split where a part of it goes.
    if (is_wide && !from_.nodeHasChildren(&from) && gone_in(area) > 0) from_.expandNode(&from);
    if (!from_.nodeHasChildren(&from)) return;
    for (unsigned i = 0; i < 8; ++i) {
      if (!from_.nodeChildExists(&from, i)) continue;
      octomap::OcTreeNode& child = *from_.getNodeChild(&from, i);
      // Below a column's width all or nothing stays.
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

std::map<OctreeColumn, ColumnTiles> columns_of(const MapSnapshot& view, double resolution_m) {
  std::map<OctreeColumn, ColumnTiles> columns;
  // A hair inside, so that a tile does not touch the column beyond its far edge.
  const double far_side_m = view.tile_size_m - 0.5 * resolution_m;
  for (const auto& tile : view.tiles) {
    const double x_map = tile->info.id.x * view.tile_size_m;
    const double y_map = tile->info.id.y * view.tile_size_m;
    const OctreeColumn first{column_at(x_map, resolution_m), column_at(y_map, resolution_m)};
    const OctreeColumn last{column_at(x_map + far_side_m, resolution_m),
                            column_at(y_map + far_side_m, resolution_m)};
    for (OctreeColumn at = first; at.x <= last.x; ++at.x) {
      for (at.y = first.y; at.y <= last.y; ++at.y) {
        ColumnTiles& column = columns[at];
        if (is_non_resident(*tile)) {
          column.has_nonresident = true;
        } else {
          column.resident.push_back(tile);
        }
      }
    }
  }
  return columns;
}

void evict_columns(octomap::OcTree& octree, const std::set<OctreeColumn>& columns) {
  OctreeCopy left(octree.getResolution());
  Pruner(octree, left, columns).copy_all();
  octree.swapContent(left);
}

}  // namespace stillmap
