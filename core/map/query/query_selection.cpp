#include "core/map/query/query_selection.hpp"

#include <algorithm>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

TileChangeKind kind_of(const TileInfo& info, const MapQuery& query, const TileHistory* history) {
  if (!query.since || history == nullptr) return TileChangeKind::appeared;
  const auto found =
      std::ranges::lower_bound(history->appeared, info.id, {}, &TileHistory::Event::id);
  const bool was_there = found != history->appeared.end() && found->id == info.id &&
                         found->version <= query.since->version;
  return was_there ? TileChangeKind::changed : TileChangeKind::appeared;
}

}  // namespace

VoxelFilter::VoxelFilter(const MapQuery& query, const RegionShape& region, const Tile& tile)
    : query_(query),
      is_inside_(region.covers(tile.info.bounds_map.cast<double>())),
      matches_all_classes_(query.classes.none() || query.classes.all()),
      near_(region.restricted_to(tile.info.bounds_map.cast<double>())) {}

std::uint32_t VoxelFilter::count(const Tile& tile) const {
  return static_cast<std::uint32_t>(
      std::ranges::count_if(tile.voxels, [&](const Voxel& voxel) { return matches(voxel); }));
}

std::vector<std::size_t> selected_tiles(const MapSnapshot& view, const MapQuery& query,
                                        const RegionShape& region) {
  std::vector<std::size_t> selected;
  if (query.since) {
    for (std::size_t i = 0; i < view.tiles.size(); ++i) {
      const TileInfo& info = view.tiles[i]->info;
      if (info.revision > query.since->version &&
          region.may_intersect(tile_footprint(info.id, view.tile_size_m))) {
        selected.push_back(i);
      }
    }
    return selected;
  }
  for (const std::size_t i : tiles_in_box(view, region.bounds_map())) {
    if (region.may_intersect(view.tiles[i]->info.bounds_map.cast<double>())) selected.push_back(i);
  }
  return selected;
}

std::vector<TileChange> tile_changes(const MapSnapshot& view, const MapQuery& query,
                                     const RegionShape& region,
                                     const std::vector<std::size_t>& selected,
                                     const TileHistory* history, TileReader& reader) {
  std::vector<TileChange> changes;
  changes.reserve(selected.size());
  for (const std::size_t i : selected) {
    const TileInfo& info = view.tiles[i]->info;
    const VoxelFilter filter(query, region, *view.tiles[i]);
    const std::uint32_t count =
        filter.matches_all() ? info.voxel_count : filter.count(*reader.read(view.tiles[i]));
    changes.push_back({info.id, kind_of(info, query, history), info.revision, count});
  }
  if (!query.since || history == nullptr) return changes;
  for (const auto& [id, version] : history->removed) {
    if (version > query.since->version &&
        region.may_intersect(tile_footprint(id, view.tile_size_m))) {
      changes.push_back({id, TileChangeKind::removed, version, 0});
    }
  }
  return changes;
}

}  // namespace stillmap
