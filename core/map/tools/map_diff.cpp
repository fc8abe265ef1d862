#include "core/map/tools/map_diff.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>

#include "core/map/tools/class_lookup.hpp"

namespace stillmap {
namespace {

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
