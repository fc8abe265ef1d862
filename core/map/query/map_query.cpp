#include "core/map/query/map_query.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <sstream>
#include <vector>

#include "core/map/packed_voxels.hpp"
#include "core/map/query/coarse_cells.hpp"
#include "core/map/query/coarse_strips.hpp"
#include "core/map/query/query_checks.hpp"
#include "core/map/query/region.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// Tiles that a first page reads to count what a query takes of each; a second or so.
constexpr std::size_t max_counted_tiles = 10'000;

/// Of a row of merged cells: 20 km of tiles of 20 m, four deep.
constexpr std::size_t max_row_tiles = 4'000;

/// Voxels that a page of a coarser answer merges, about; a second or so.
constexpr std::uint64_t max_merged_voxels = 1'000'000;

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
  [[nodiscard]] bool matches(const Eigen::Vector3f& mean_map, const ClassEvidence& evidence) const {
    return (is_inside_ || near_.contains_mean(mean_map)) &&
           (matches_all_classes_ ||
            query_.classes.test(static_cast<std::size_t>(evidence.winner())));
  }
  /// How many of the tile's voxels it matches, from the `begin`-th on.
  [[nodiscard]] std::uint32_t count(const Tile& tile, std::size_t begin) const {
    const std::span<const PackedVoxel> voxels = tile.voxels.packed().subspan(begin);
    if (matches_all()) return static_cast<std::uint32_t>(voxels.size());
    const VoxelGrid grid = tile.voxels.grid();
    return static_cast<std::uint32_t>(std::ranges::count_if(voxels, [&](const PackedVoxel& voxel) {
      return matches(mean_map(voxel, tile.info.id, grid), voxel.evidence);
    }));
  }

 private:
  const MapQuery& query_;
  bool is_inside_;
  bool matches_all_classes_;
  RegionShape near_;
};

TileChangeKind kind_of(const TileInfo& info, const MapQuery& query, const TileHistory* history) {
  if (!query.since || history == nullptr) return TileChangeKind::appeared;
  return info.appeared_in <= query.since->version ? TileChangeKind::changed
                                                  : TileChangeKind::appeared;
}

using TilePointers = std::vector<std::shared_ptr<const Tile>>;

/// Sorted by id, the tiles that an answer is made from: those with voxels near the region; with
/// `since`, those that changed and whose footprint meets it, even if no voxel is left there.
TilePointers selected_tiles(const MapSnapshot& view, const MapQuery& query,
                            const RegionShape& region) {
  TilePointers selected;
  if (query.since) {
    view.tiles.for_each_newer(query.since->version, [&](const auto& tile) {
      if (region.may_intersect(tile_footprint(tile->info.id, view.tile_size_m))) {
        selected.push_back(tile);
      }
    });
    return selected;
  }
  for (auto& tile : tiles_in_box(view, region.bounds_map())) {
    if (region.may_intersect(tile->info.bounds_map.template cast<double>())) {
      selected.push_back(std::move(tile));
    }
  }
  return selected;
}

/// A valid query, and what its answer is read from.
struct Selection {
  const MapSnapshot& view;
  const MapQuery& query;
  RegionShape region;
  TilePointers tiles;
  TileReader& reader;
};

std::uint64_t voxel_count(const TilePointers& tiles) {
  std::uint64_t count = 0;
  for (const auto& tile : tiles) count += tile->info.voxel_count;
  return count;
}

/// Adds the voxels that a filter matches to a page, from the `begin`-th on. Returns the first of
/// them for which the page has no room; else the number of voxels.
std::size_t add_voxels(const Tile& tile, const VoxelFilter& filter, std::size_t begin,
                       std::size_t max_voxels, std::vector<QueryVoxel>& page) {
  const std::span<const PackedVoxel> voxels = tile.voxels.packed();
  const VoxelGrid grid = tile.voxels.grid();
  for (std::size_t v = begin; v < voxels.size(); ++v) {
    const PackedVoxel& voxel = voxels[v];
    const Eigen::Vector3f mean = mean_map(voxel, tile.info.id, grid);
    if (!filter.matches(mean, voxel.evidence)) continue;
    if (page.size() == max_voxels) return v;
    page.push_back({mean, voxel.evidence.winner(), voxel.evidence.share(), voxel.point_count});
  }
  return voxels.size();
}

std::size_t page_size(const MapQuery& query) { return query.max_bytes / query_voxel_bytes; }

/// A page of the map's own voxels from `position` on. Advances `position` to the first voxel of the
/// next page; true when there is one.
bool fill_page(const Selection& from, Continuation& position, std::vector<QueryVoxel>& page) {
  for (; position.tile < from.tiles.size(); ++position.tile, position.voxel = 0) {
    const auto tile = from.reader.read(from.tiles[position.tile]);
    const VoxelFilter filter(from.query, from.region, *tile);
    position.voxel = add_voxels(*tile, filter, position.voxel, page_size(from.query), page);
    if (position.voxel < tile->voxels.size()) return true;
  }
  return false;
}

/// The page of an answer of which all fits in one, tiles beside each other. Returns how many voxels
/// the answer has of each.
std::vector<std::uint32_t> fill_only_page(const Selection& from, std::vector<QueryVoxel>& page) {
  std::vector<std::vector<QueryVoxel>> voxels(from.tiles.size());
  tbb::parallel_for(std::size_t{0}, from.tiles.size(), [&](std::size_t i) {
    const auto tile = from.reader.read(from.tiles[i]);
    const VoxelFilter filter(from.query, from.region, *tile);
    if (filter.matches_all()) voxels[i].reserve(tile->voxels.size());
    add_voxels(*tile, filter, 0, page_size(from.query), voxels[i]);
  });
  std::vector<std::uint32_t> counts;
  counts.reserve(voxels.size());
  for (const auto& of_tile : voxels) counts.push_back(static_cast<std::uint32_t>(of_tile.size()));
  page.reserve(std::reduce(counts.begin(), counts.end(), std::size_t{0}));
  for (const auto& of_tile : voxels) page.insert(page.end(), of_tile.begin(), of_tile.end());
  return counts;
}

/// An answer's first page, of several. Returns how many voxels the answer has of each tile.
std::vector<std::uint32_t> fill_first_page(const Selection& from, Continuation& position,
                                           std::vector<QueryVoxel>& page, bool& has_more) {
  std::vector<std::uint32_t> counts;
  counts.reserve(from.tiles.size());
  page.reserve(page_size(from.query));
  for (const auto& selected : from.tiles) {
    const VoxelFilter filter(from.query, from.region, *selected);
    if (has_more && filter.matches_all()) {
      counts.push_back(selected->info.voxel_count);
      continue;
    }
    const auto tile = from.reader.read(selected);
    const std::size_t before = page.size();
    const std::size_t end =
        has_more ? 0 : add_voxels(*tile, filter, 0, page_size(from.query), page);
    counts.push_back(static_cast<std::uint32_t>(page.size() - before) + filter.count(*tile, end));
    if (!has_more && end < tile->voxels.size()) {
      has_more = true;
      position.tile = counts.size() - 1;
      position.voxel = end;
    }
  }
  return counts;
}

/// The tiles of an answer that has so many voxels of each, and those that are gone.
std::vector<TileChange> tile_changes(const Selection& from,
                                     std::span<const std::uint32_t> voxel_counts,
                                     const TileHistory* history) {
  std::vector<TileChange> changes;
  changes.reserve(from.tiles.size());
  for (std::size_t i = 0; i < from.tiles.size(); ++i) {
    const TileInfo& info = from.tiles[i]->info;
    changes.push_back(
        {info.id, kind_of(info, from.query, history), info.revision, voxel_counts[i]});
  }
  if (!from.query.since || history == nullptr) return changes;
  for (const auto& [id, version] : history->removed) {
    if (version > from.query.since->version &&
        from.region.may_intersect(tile_footprint(id, from.view.tile_size_m))) {
      changes.push_back({id, TileChangeKind::removed, version, 0});
    }
  }
  return changes;
}

std::uint64_t voxel_count(const Selection& from, std::span<const std::size_t> tiles) {
  std::uint64_t count = 0;
  for (const std::size_t i : tiles) count += from.tiles[i]->info.voxel_count;
  return count;
}

/// Where the voxels of these tiles lie that may be in the region, map frame [m].
Eigen::AlignedBox3f bounds_map(const Selection& from, std::span<const std::size_t> tiles) {
  Eigen::AlignedBox3f bounds;
  for (const std::size_t i : tiles) bounds.extend(from.tiles[i]->info.bounds_map);
  // A cell more on each side: its ends may be rounded inwards.
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(from.query.resolution_m);
  const Eigen::AlignedBox3d& region = from.region.bounds_map();
  return bounds.intersection(
      Eigen::AlignedBox3d(region.min() - margin, region.max() + margin).cast<float>());
}

/// The cells of one strip of a coarser answer, merged from the tiles that reach into it.
std::vector<QueryVoxel> merge(const Selection& from, const CoarseStrips& strips,
                              std::size_t strip) {
  // So many of a surface meet in one.
  const double edge = from.query.resolution_m / from.view.voxel_size_m;
  const auto voxels = static_cast<double>(voxel_count(from, strips.tiles(strip)));
  CoarseCells cells(from.query.resolution_m, bounds_map(from, strips.tiles(strip)),
                    static_cast<std::size_t>(voxels / (edge * edge)));
  for (const std::size_t i : strips.tiles(strip)) {
    const auto tile = from.reader.read(from.tiles[i]);
    const VoxelFilter filter(from.query, from.region, *tile);
    const VoxelGrid grid = tile->voxels.grid();
    const Eigen::AlignedBox3f& bounds_map = tile->info.bounds_map;
    const bool is_whole = strips.covers(strip, bounds_map.min().x(), bounds_map.max().x());
    for (const PackedVoxel& voxel : tile->voxels.packed()) {
      const Eigen::Vector3f mean = mean_map(voxel, tile->info.id, grid);
      if ((is_whole || strips.is_in(strip, mean.x())) && filter.matches(mean, voxel.evidence))
        cells.add(mean, voxel.point_count, voxel.evidence);
    }
  }
  return cells.sorted();
}

/// Adds a strip's cells to a page, from the `begin`-th on; false, with the first that has no room
/// there, where the page is full.
bool add_cells(const std::vector<QueryVoxel>& cells, std::size_t& begin, std::size_t max_cells,
               std::vector<QueryVoxel>& page) {
  begin = std::min(begin, cells.size());
  const std::size_t end = begin + std::min(cells.size() - begin, max_cells - page.size());
  page.insert(page.end(), cells.begin() + static_cast<std::ptrdiff_t>(begin),
              cells.begin() + static_cast<std::ptrdiff_t>(end));
  begin = end;
  return end == cells.size();
}

/// Cells of some strips, from one on, merged beside each other: of one at least, and of no more
/// voxels than there may be cells, so that nothing is merged for a later page.
std::vector<std::vector<QueryVoxel>> merge_some(const Selection& from, const CoarseStrips& strips,
                                                std::size_t first, std::uint64_t max_cells,
                                                std::uint64_t& merged) {
  std::uint64_t voxels = 0;
  std::size_t end = first;
  do voxels += voxel_count(from, strips.tiles(end++));
  while (end < strips.size() && voxels + voxel_count(from, strips.tiles(end)) <= max_cells);
  merged += voxels;
  std::vector<std::vector<QueryVoxel>> cells(end - first);
  tbb::parallel_for(first, end,
                    [&](std::size_t strip) { cells[strip - first] = merge(from, strips, strip); });
  return cells;
}

/// A page of a coarser answer. The answer is made strip by strip, so that a page merges its own
/// part of the region and ends when that is much; the first page counts the rest where it is
/// little.
bool fill_coarse_page(const Selection& from, Continuation& position,
                      std::vector<QueryVoxel>& page) {
  const CoarseStrips strips(from.tiles, from.query.resolution_m, from.view.tile_size_m);
  const bool is_first = from.query.continuation.empty();
  if (is_first) position.total_voxels = voxel_count(from.tiles);
  const bool counts = is_first && position.total_voxels <= max_merged_voxels;
  std::uint64_t total = 0;
  std::uint64_t merged = 0;
  bool has_more = false;
  std::size_t begin = position.voxel;
  for (std::size_t strip = position.tile; strip < strips.size();) {
    if (merged >= max_merged_voxels && !counts) {
      position.tile = strip;
      position.voxel = 0;
      return true;
    }
    // What is counted is merged in any case.
    const std::uint64_t max_cells =
        counts ? max_merged_voxels : page_size(from.query) - page.size();
    for (const auto& cells : merge_some(from, strips, strip, max_cells, merged)) {
      total += cells.size();
      if (!has_more && !add_cells(cells, begin, page_size(from.query), page)) {
        has_more = true;
        position.tile = strip;
        position.voxel = begin;
        if (!counts) return true;
      }
      begin = 0;
      ++strip;
    }
  }
  if (counts) position.total_voxels = total;
  return has_more;
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

/// Set where the cells are so large that one row of them is made of too many tiles: no page can
/// end within a row.
std::optional<Refusal> coarseness_refusal(const Selection& from) {
  const CoarseStrips strips(from.tiles, from.query.resolution_m, from.view.tile_size_m);
  std::size_t tiles = 0;
  for (std::size_t strip = 0; strip < strips.size(); ++strip)
    tiles = std::max(tiles, strips.tiles(strip).size());
  if (tiles <= max_row_tiles) return std::nullopt;
  std::ostringstream reason;
  reason << "a row of cells of " << from.query.resolution_m << " m is made of " << tiles
         << " tiles; at most " << max_row_tiles
         << " can be merged at once: ask for parts, or with a finer resolution_m";
  return Refusal{QueryStatus::invalid_request, reason.str()};
}

/// Set where too many tiles must be read to tell what the answer has of each: all their voxels are
/// wanted of none.
std::optional<Refusal> size_refusal(const Selection& from) {
  if (from.tiles.size() <= max_counted_tiles) return std::nullopt;
  const auto counted = std::ranges::count_if(from.tiles, [&](const auto& tile) {
    return !VoxelFilter(from.query, from.region, *tile).matches_all();
  });
  if (static_cast<std::size_t>(counted) <= max_counted_tiles) return std::nullopt;
  std::ostringstream reason;
  reason << "the region has " << counted << " tiles of which the query wants some of the voxels; "
         << "at most " << max_counted_tiles
         << " can be answered: ask for parts, for all classes, or with a coarser resolution_m";
  return Refusal{QueryStatus::invalid_request, reason.str()};
}

/// A page of an answer with the map's own voxels. The first one has the tiles and the number of
/// voxels of the whole answer. True when there are more.
bool add_page(const Selection& from, const TileHistory* history, Continuation& position,
              MapQueryResult& result) {
  if (!from.query.continuation.empty()) return fill_page(from, position, result.voxels);
  bool has_more = false;
  const auto counts = voxel_count(from.tiles) <= page_size(from.query)
                          ? fill_only_page(from, result.voxels)
                          : fill_first_page(from, position, result.voxels, has_more);
  result.tiles = tile_changes(from, counts, history);
  for (const TileChange& tile : result.tiles) position.total_voxels += tile.voxel_count;
  return has_more;
}

}  // namespace

MapQueryResult query_map(const MapSnapshot& view, const MapQuery& query, const TileHistory* history,
                         TileReader& reader) {
  auto [position, refusal] = start_of(view, query, history);
  if (refusal) return result_of(view, refusal->status, std::move(refusal->reason));

  const RegionShape region(query.region);
  const Selection selection{view, query, region, selected_tiles(view, query, region), reader};
  const bool is_coarse = is_coarser_than_map(view, query.resolution_m);
  if (is_coarse) {
    refusal = coarseness_refusal(selection);
  } else if (query.continuation.empty()) {
    refusal = size_refusal(selection);
  }
  if (refusal) return result_of(view, refusal->status, std::move(refusal->reason));
  MapQueryResult result = result_of(view, QueryStatus::ok, {});
  const bool has_more = is_coarse ? fill_coarse_page(selection, position, result.voxels)
                                  : add_page(selection, history, position, result);
  result.total_voxels = position.total_voxels;
  if (has_more) result.continuation = to_token(position);
  return result;
}

MapQueryResult query_map(const MapSnapshot& view, const MapQuery& query,
                         const TileHistory* history) {
  TileReader reader;
  return query_map(view, query, history, reader);
}

std::optional<MapVersion> continued_map(const std::string& continuation) {
  const std::optional<Continuation> token = from_token(continuation);
  if (!token) return std::nullopt;
  return MapVersion{token->map_id, token->map_version};
}

}  // namespace stillmap
