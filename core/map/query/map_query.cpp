#include "core/map/query/map_query.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/map/query/coarse_cells.hpp"
#include "core/map/query/query_checks.hpp"
#include "core/map/query/region.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// Selects the voxels of a tile that a query asks for.
class VoxelFilter {
 public:
  /// The tile may be non-resident: its info tells whether all of it is taken.
  VoxelFilter(const MapQuery& query, const RegionShape& region, const Tile& tile)
      : query_(query),
        is_inside_(region.covers(tile.info.bounds_map.cast<double>())),
        matches_all_classes_(query.classes.none() || query.classes.all()),
        near_(region.restricted_to(tile.info.bounds_map.cast<double>())) {}

  [[nodiscard]] bool matches_all() const { return is_inside_ && matches_all_classes_; }
  [[nodiscard]] bool matches(const Voxel& voxel) const {
    return (is_inside_ || near_.contains(voxel.mean_map.cast<double>())) &&
           (matches_all_classes_ ||
            query_.classes.test(static_cast<std::size_t>(voxel.evidence.winner())));
  }
  /// How many of the tile's voxels it matches.
  [[nodiscard]] std::uint32_t count(const Tile& tile) const {
    return static_cast<std::uint32_t>(
        std::ranges::count_if(tile.voxels, [&](const Voxel& voxel) { return matches(voxel); }));
  }

 private:
  const MapQuery& query_;
  bool is_inside_;
  bool matches_all_classes_;
  RegionShape near_;
};

TileChangeKind kind_of(const TileInfo& info, const MapQuery& query, const TileHistory* history) {
  if (!query.since || history == nullptr) return TileChangeKind::appeared;
  const auto found =
      std::ranges::lower_bound(history->appeared, info.id, {}, &TileHistory::Event::id);
  const bool was_there = found != history->appeared.end() && found->id == info.id &&
                         found->version <= query.since->version;
  return was_there ? TileChangeKind::changed : TileChangeKind::appeared;
}

/// Positions in `view.tiles`, ascending, of the tiles that an answer is made from: those with
/// voxels near the region; with `since`, those that changed and whose footprint meets it, even if
/// no voxel is left there.
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

/// The tiles of an answer; `selected` as selected_tiles returns it.
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

QueryVoxel query_voxel(const Voxel& voxel) {
  return {voxel.mean_map, voxel.evidence.winner(), voxel.evidence.share(), voxel.point_count};
}

/// A valid query, and what its answer is read from.
struct Selection {
  const MapSnapshot& view;
  const MapQuery& query;
  RegionShape region;
  std::vector<std::size_t> tiles;
  TileReader& reader;
};

/// A page of the map's own voxels from `position` on. Advances `position` to the first voxel of the
/// next page; true when there is one.
bool fill_page(const Selection& from, Continuation& position, std::vector<QueryVoxel>& page) {
  const std::size_t page_size = from.query.max_bytes / query_voxel_bytes;
  for (const std::size_t i : from.tiles) {
    if (i < position.tile) continue;
    const auto read = from.reader.read(from.view.tiles[i]);
    const Tile& tile = *read;
    const VoxelFilter filter(from.query, from.region, tile);
    for (std::size_t v = i == position.tile ? position.voxel : 0; v < tile.voxels.size(); ++v) {
      if (!filter.matches(tile.voxels[v])) continue;
      if (page.size() == page_size) {
        position.tile = i;
        position.voxel = v;
        return true;
      }
      page.push_back(query_voxel(tile.voxels[v]));
    }
  }
  return false;
}

/// A page of a coarser answer. Every page merges the whole region anew: nothing is kept between
/// requests.
bool fill_coarse_page(const Selection& from, Continuation& position,
                      std::vector<QueryVoxel>& page) {
  CoarseCells cells(from.query.resolution_m);
  for (const std::size_t i : from.tiles) {
    const auto tile = from.reader.read(from.view.tiles[i]);
    const VoxelFilter filter(from.query, from.region, *tile);
    for (const Voxel& voxel : tile->voxels) {
      if (filter.matches(voxel)) cells.add(voxel);
    }
  }
  const std::vector<QueryVoxel> all = cells.sorted();
  const std::size_t begin = std::min<std::size_t>(position.voxel, all.size());
  const std::size_t end = std::min(all.size(), begin + from.query.max_bytes / query_voxel_bytes);
  page.assign(all.begin() + static_cast<std::ptrdiff_t>(begin),
              all.begin() + static_cast<std::ptrdiff_t>(end));
  position.total_voxels = all.size();
  position.voxel = end;
  return end < all.size();
}

MapQueryResult result_of(const MapSnapshot& view, QueryStatus status, std::string reason) {
  MapQueryResult result;
  result.status = status;
  result.reason = std::move(reason);
  result.map_version = view.version;
  result.map_id = view.map_id;
  return result;
}

/// Where a page begins, or why the query is refused.
struct Start {
  Continuation position;
  std::optional<Refusal> refusal;
};

Start start_of(const MapSnapshot& view, const MapQuery& query, const TileHistory* history) {
  if (std::string faults = query_faults(view, query); !faults.empty()) {
    return {{}, Refusal{QueryStatus::invalid_request, std::move(faults)}};
  }
  if (query.continuation.empty()) {
    return {{view.map_id, view.version, fingerprint(query), 0, 0, 0},
            query.since ? since_refusal(view, *query.since, history) : std::nullopt};
  }
  const std::optional<Continuation> token = from_token(query.continuation);
  return {token.value_or(Continuation()), token_refusal(view, query, token)};
}

/// Fills in the tiles and the number of voxels of the whole answer, for its first page.
void add_tiles(const Selection& selection, const TileHistory* history, Continuation& position,
               MapQueryResult& result) {
  result.tiles = tile_changes(selection.view, selection.query, selection.region, selection.tiles,
                              history, selection.reader);
  for (const TileChange& tile : result.tiles) position.total_voxels += tile.voxel_count;
}

}  // namespace

MapQueryResult query_map(const MapSnapshot& view, const MapQuery& query, const TileHistory* history,
                         TileReader& reader) {
  auto [position, refusal] = start_of(view, query, history);
  if (refusal) return result_of(view, refusal->status, std::move(refusal->reason));

  const RegionShape region(query.region);
  const Selection selection{view, query, region, selected_tiles(view, query, region), reader};
  const bool is_coarse = is_coarser_than_map(view, query.resolution_m);
  MapQueryResult result = result_of(view, QueryStatus::ok, {});
  if (!is_coarse && query.continuation.empty()) add_tiles(selection, history, position, result);
  const bool has_more = is_coarse ? fill_coarse_page(selection, position, result.voxels)
                                  : fill_page(selection, position, result.voxels);
  result.total_voxels = position.total_voxels;
  if (has_more) result.continuation = to_token(position);
  return result;
}

MapQueryResult query_map(const MapSnapshot& view, const MapQuery& query,
                         const TileHistory* history) {
  TileReader reader;
  return query_map(view, query, history, reader);
}

std::optional<std::uint64_t> continuation_version(const std::string& continuation) {
  const std::optional<Continuation> token = from_token(continuation);
  if (!token) return std::nullopt;
  return token->map_version;
}

}  // namespace stillmap
