#include "core/map/tools/map_diff.hpp"

#include <tbb/parallel_for.h>
#include <tsl/robin_map.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

/// What stands near a cell.
struct NearClasses {
  /// A voxel of the class asked for is within reach.
  bool has_same = false;
  /// Class of the nearest voxel within reach, of equally near ones the first by index; not looked
  /// for when `has_same`.
  std::optional<SemanticClass> nearest;
};

/// The classes of a map's voxels by cell, across the borders of tiles.
class ClassLookup {
 public:
  /// Of `view`, for questions about cells of `asking`, which has tiles and voxels of the same size
  /// unless one of them is empty.
  ClassLookup(const MapSnapshot& view, const MapSnapshot& asking) {
    const MapSnapshot& filled = view.tiles.empty() ? asking : view;
    if (!filled.tiles.empty()) columns_ = std::llround(filled.tile_size_m / filled.voxel_size_m);
    std::size_t voxels = 0;
    for (const auto& tile : view.tiles) voxels += tile->voxels.size();
    class_of_.reserve(voxels);
    for (const auto& tile : view.tiles) {
      for (const Voxel& voxel : tile->voxels) {
        class_of_[key_of(cell(tile->info.id, voxel.index))] = voxel.evidence.winner();
      }
    }
  }

  /// Looks at all cells at most `reach` cells away along each axis. Thread-safe.
  [[nodiscard]] NearClasses near(TileId tile, VoxelIndex index, SemanticClass label,
                                 int reach) const {
    const Cell centre = cell(tile, index);
    // In most of the map nothing changed.
    if (at(centre) == label) return {.has_same = true, .nearest = std::nullopt};
    return search(centre, label, reach);
  }

 private:
  /// Column, row and layer of the whole map.
  using Cell = Eigen::Matrix<std::int64_t, 3, 1>;

  static std::uint64_t key_of(const Cell& cell) {
    // No map spans 2^21 voxels: at the finest in use, 5 cm, that were 100 km.
    return packed_index(cell.x(), cell.y(), cell.z());
  }

  [[nodiscard]] Cell cell(TileId tile, VoxelIndex index) const {
    return {tile.x * columns_ + index.x, tile.y * columns_ + index.y, index.z};
  }
  [[nodiscard]] std::optional<SemanticClass> at(const Cell& cell) const {
    const auto found = class_of_.find(key_of(cell));
    return found == class_of_.end() ? std::nullopt : std::optional(found->second);
  }
  [[nodiscard]] NearClasses search(const Cell& centre, SemanticClass label, int reach) const;

  /// Voxels along a tile's side.
  std::int64_t columns_ = 1;
  tsl::robin_map<std::uint64_t, SemanticClass, IndexHash> class_of_;
};

NearClasses ClassLookup::search(const Cell& centre, SemanticClass label, int reach) const {
  NearClasses near;
  std::int64_t nearest_squared = 0;
  for (int x = -reach; x <= reach; ++x) {
    for (int y = -reach; y <= reach; ++y) {
      for (int z = -reach; z <= reach; ++z) {
        const auto found = at(centre + Cell(x, y, z));
        if (!found) continue;
        if (*found == label) return {.has_same = true, .nearest = std::nullopt};
        const std::int64_t squared = x * x + y * y + z * z;
        if (near.nearest && squared >= nearest_squared) continue;
        near.nearest = found;
        nearest_squared = squared;
      }
    }
  }
  return near;
}

using TileChanges = std::vector<VoxelDifference>;

std::string sizes(const MapSnapshot& view) {
  return "voxels of " + std::to_string(view.voxel_size_m) + " m in tiles of " +
         std::to_string(view.tile_size_m) + " m";
}

void check(const MapSnapshot& before, const MapSnapshot& after, const MapDiffOptions& options) {
  if (options.tolerance_voxels < 0 ||
      options.tolerance_voxels > MapDiffOptions::max_tolerance_voxels) {
    throw std::invalid_argument("tolerance_voxels is " + std::to_string(options.tolerance_voxels) +
                                ", must be 0 to " +
                                std::to_string(MapDiffOptions::max_tolerance_voxels));
  }
  if (before.tiles.empty() || after.tiles.empty()) return;
  if (before.voxel_size_m == after.voxel_size_m && before.tile_size_m == after.tile_size_m) return;
  throw std::invalid_argument("the maps cannot be compared: one has " + sizes(before) +
                              ", the other " + sizes(after) +
                              "; map both recordings with the same static_map configuration");
}

/// What became of a voxel of the earlier map; nothing when it is still there.
std::optional<VoxelDifference> change_of(const Voxel& voxel, TileId tile, const ClassLookup& after,
                                         int tolerance_voxels) {
  const SemanticClass label = voxel.evidence.winner();
  const NearClasses near = after.near(tile, voxel.index, label, tolerance_voxels);
  if (near.has_same) return std::nullopt;
  if (!near.nearest) {
    return VoxelDifference{VoxelChange::gone, voxel.mean_map, label, SemanticClass::unlabeled};
  }
  return VoxelDifference{VoxelChange::relabelled, voxel.mean_map, label, *near.nearest};
}

/// A voxel of the later map, if it is new.
std::optional<VoxelDifference> addition_of(const Voxel& voxel, TileId tile,
                                           const ClassLookup& before, int tolerance_voxels) {
  const SemanticClass label = voxel.evidence.winner();
  const NearClasses near = before.near(tile, voxel.index, label, tolerance_voxels);
  if (near.has_same || near.nearest) return std::nullopt;
  return VoxelDifference{VoxelChange::appeared, voxel.mean_map, SemanticClass::unlabeled, label};
}

/// `compare` for every voxel of the view against the other map, tile by tile.
template <typename Compare>
std::vector<TileChanges> compare_voxels(const MapSnapshot& view, const MapSnapshot& other,
                                        int tolerance_voxels, Compare compare) {
  const ClassLookup lookup(other, view);
  std::vector<TileChanges> changes(view.tiles.size());
  tbb::parallel_for(std::size_t{0}, view.tiles.size(), [&](std::size_t i) {
    const Tile& tile = *view.tiles[i];
    for (const Voxel& voxel : tile.voxels) {
      if (const auto change = compare(voxel, tile.info.id, lookup, tolerance_voxels)) {
        changes[i].push_back(*change);
      }
    }
  });
  return changes;
}

void count_change(const VoxelDifference& difference, MapDiff& diff) {
  const bool is_new = difference.change == VoxelChange::appeared;
  const SemanticClass label = is_new ? difference.after : difference.before;
  diff.counts.add(difference.change);
  diff.classes.at(static_cast<std::size_t>(label)).counts.add(difference.change);
  if (difference.change == VoxelChange::relabelled) {
    ++diff.relabelled[{difference.before, difference.after}];
  }
}

void add_tiles(const MapSnapshot& view, const std::vector<TileChanges>& changes,
               std::map<TileId, DifferenceCounts>& tiles, MapDiff& diff) {
  for (std::size_t i = 0; i < changes.size(); ++i) {
    if (changes[i].empty()) continue;
    DifferenceCounts& counts = tiles[view.tiles[i]->info.id];
    for (const VoxelDifference& difference : changes[i]) {
      counts.add(difference.change);
      count_change(difference, diff);
    }
    diff.voxels.insert(diff.voxels.end(), changes[i].begin(), changes[i].end());
  }
}

void count_voxels(const MapSnapshot& view, std::uint64_t ClassDifference::*count, MapDiff& diff) {
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      ++(diff.classes.at(static_cast<std::size_t>(voxel.evidence.winner())).*count);
    }
  }
}

}  // namespace

void DifferenceCounts::add(VoxelChange change) {
  switch (change) {
    case VoxelChange::appeared:
      ++appeared;
      break;
    case VoxelChange::gone:
      ++gone;
      break;
    case VoxelChange::relabelled:
      ++relabelled;
      break;
  }
}

MapDiff diff_maps(const MapSnapshot& before, const MapSnapshot& after,
                  const MapDiffOptions& options) {
  check(before, after, options);
  MapDiff diff;
  count_voxels(before, &ClassDifference::voxels_before, diff);
  count_voxels(after, &ClassDifference::voxels_after, diff);
  std::map<TileId, DifferenceCounts> tiles;
  add_tiles(before, compare_voxels(before, after, options.tolerance_voxels, change_of), tiles,
            diff);
  add_tiles(after, compare_voxels(after, before, options.tolerance_voxels, addition_of), tiles,
            diff);
  for (const auto& [id, counts] : tiles) diff.tiles.push_back({id, counts});
  return diff;
}

}  // namespace stillmap
