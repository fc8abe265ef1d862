#include "core/map/map_query.hpp"

#include <xxhash.h>

#include <array>
#include <bit>
#include <cmath>
#include <sstream>

#include "core/map/coarse_cells.hpp"
#include "core/map/continuation.hpp"
#include "core/map/tile_lookup.hpp"

namespace stillmap {
namespace {

/// Resolutions that differ by less are the same: one came over the wire as float.
constexpr double resolution_tolerance = 1e-6;

bool wants_coarse(const MapView& view, double resolution_m) {
  return resolution_m > view.voxel_size_m * (1.0 + resolution_tolerance);
}

/// What cannot be answered, in words; empty when the query is fine.
std::string query_fault(const MapView& view, const MapQuery& query) {
  constexpr std::array axes{'x', 'y', 'z'};
  std::ostringstream fault;
  for (int axis = 0; axis < 3; ++axis) {
    const double min = query.box_map.min()[axis];
    const double max = query.box_map.max()[axis];
    if (min <= max) continue;
    fault << "box " << axes.at(static_cast<std::size_t>(axis)) << " is from " << min << " to "
          << max << "; must be two numbers, the lower one first (infinity is allowed). ";
  }
  const double resolution_m = query.resolution_m;
  const double finest_m = view.voxel_size_m * (1.0 - resolution_tolerance);
  if (resolution_m != 0.0 && !(resolution_m >= finest_m && std::isfinite(resolution_m))) {
    fault << "resolution_m is " << resolution_m << "; must be 0 (the map's own) or from "
          << view.voxel_size_m << " up. ";
  }
  if (query.max_bytes < query_voxel_bytes) {
    fault << "max_bytes is " << query.max_bytes << "; must be at least " << query_voxel_bytes
          << ", the size of one voxel. ";
  }
  return fault.str();
}

std::uint64_t fingerprint(const MapQuery& query) {
  std::array<std::uint64_t, 8> words{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    words.at(i) = std::bit_cast<std::uint64_t>(query.box_map.min()[axis]);
    words.at(i + 3) = std::bit_cast<std::uint64_t>(query.box_map.max()[axis]);
  }
  words[6] = query.classes.to_ullong();
  words[7] = std::bit_cast<std::uint64_t>(query.resolution_m);
  return XXH3_64bits(words.data(), sizeof(words));
}

/// Which voxels of a tile are asked for.
class VoxelFilter {
 public:
  VoxelFilter(const MapQuery& query, const Tile& tile)
      : query_(query),
        is_inside_(query.box_map.contains(tile.info.bounds_map.cast<double>())),
        takes_all_classes_(query.classes.none() || query.classes.all()) {}

  [[nodiscard]] bool takes_all() const { return is_inside_ && takes_all_classes_; }
  [[nodiscard]] bool takes(const Voxel& voxel) const {
    return (is_inside_ || query_.box_map.contains(voxel.mean_map.cast<double>())) &&
           (takes_all_classes_ ||
            query_.classes.test(static_cast<std::size_t>(voxel.evidence.winner())));
  }

 private:
  const MapQuery& query_;
  bool is_inside_;
  bool takes_all_classes_;
};

std::uint64_t count_voxels(const MapView& view, const MapQuery& query,
                           const std::vector<std::size_t>& tiles) {
  std::uint64_t count = 0;
  for (const std::size_t i : tiles) {
    const Tile& tile = *view.tiles[i];
    const VoxelFilter filter(query, tile);
    if (filter.takes_all()) {
      count += tile.voxels.size();
      continue;
    }
    for (const Voxel& voxel : tile.voxels) count += filter.takes(voxel) ? 1 : 0;
  }
  return count;
}

QueryVoxel query_voxel(const Voxel& voxel) {
  return {voxel.mean_map, voxel.evidence.winner(), voxel.evidence.share(), voxel.point_count};
}

/// A page of the map's own voxels, from `position` on, which moves on to the next page's first
/// voxel. True when there is one.
bool fill_page(const MapView& view, const MapQuery& query, const std::vector<std::size_t>& tiles,
               Continuation& position, std::vector<QueryVoxel>& page) {
  const std::size_t page_size = query.max_bytes / query_voxel_bytes;
  for (const std::size_t i : tiles) {
    if (i < position.tile) continue;
    const Tile& tile = *view.tiles[i];
    const VoxelFilter filter(query, tile);
    for (std::size_t v = i == position.tile ? position.voxel : 0; v < tile.voxels.size(); ++v) {
      if (!filter.takes(tile.voxels[v])) continue;
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

/// A page of a coarser answer. Every page merges the whole box anew: the service keeps nothing
/// between requests.
bool fill_coarse_page(const MapView& view, const MapQuery& query,
                      const std::vector<std::size_t>& tiles, Continuation& position,
                      std::vector<QueryVoxel>& page) {
  CoarseCells cells(query.resolution_m);
  for (const std::size_t i : tiles) {
    const Tile& tile = *view.tiles[i];
    const VoxelFilter filter(query, tile);
    for (const Voxel& voxel : tile.voxels) {
      if (filter.takes(voxel)) cells.add(voxel);
    }
  }
  const std::vector<QueryVoxel> all = cells.sorted();
  const std::size_t begin = std::min<std::size_t>(position.voxel, all.size());
  const std::size_t end = std::min(all.size(), begin + query.max_bytes / query_voxel_bytes);
  page.assign(all.begin() + static_cast<std::ptrdiff_t>(begin),
              all.begin() + static_cast<std::ptrdiff_t>(end));
  position.total_voxels = all.size();
  position.voxel = end;
  return end < all.size();
}

MapQueryResult result_of(const MapView& view, QueryStatus status, std::string reason) {
  MapQueryResult result;
  result.status = status;
  result.reason = std::move(reason);
  result.map_version = view.version;
  result.map_id = view.map_id;
  return result;
}

/// Why the token cannot be followed on this view; nothing when it can.
std::optional<MapQueryResult> token_fault(const MapView& view, const MapQuery& query,
                                          const std::optional<Continuation>& token) {
  if (!token) {
    return result_of(view, QueryStatus::invalid_request,
                     "continuation is damaged; hand back the text of the last page as it is");
  }
  if (token->map_id != view.map_id || token->map_version != view.version) {
    std::ostringstream reason;
    reason << "continuation is of map " << token->map_id << " version " << token->map_version
           << ", the map is now " << view.map_id << " version " << view.version
           << "; ask again without continuation";
    return result_of(view, QueryStatus::stale_continuation, reason.str());
  }
  if (token->query_fingerprint != fingerprint(query)) {
    return result_of(view, QueryStatus::invalid_request,
                     "continuation is of another query; keep box, classes and resolution_m as they "
                     "were on the first page");
  }
  return std::nullopt;
}

}  // namespace

MapQueryResult query_map(const MapView& view, const MapQuery& query) {
  if (std::string fault = query_fault(view, query); !fault.empty()) {
    return result_of(view, QueryStatus::invalid_request, std::move(fault));
  }
  Continuation position{view.map_id, view.version, fingerprint(query), 0, 0, 0};
  if (!query.continuation.empty()) {
    const std::optional<Continuation> token = from_token(query.continuation);
    if (auto fault = token_fault(view, query, token)) return *std::move(fault);
    position = *token;
  }

  const std::vector<std::size_t> tiles = tiles_in_box(view, query.box_map);
  const bool is_coarse = wants_coarse(view, query.resolution_m);
  if (!is_coarse && query.continuation.empty()) {
    position.total_voxels = count_voxels(view, query, tiles);
  }
  MapQueryResult result = result_of(view, QueryStatus::ok, {});
  const bool has_more = is_coarse ? fill_coarse_page(view, query, tiles, position, result.voxels)
                                  : fill_page(view, query, tiles, position, result.voxels);
  result.total_voxels = position.total_voxels;
  if (has_more) result.continuation = to_token(position);
  return result;
}

std::optional<std::uint64_t> continuation_version(const std::string& continuation) {
  const std::optional<Continuation> token = from_token(continuation);
  if (!token) return std::nullopt;
  return token->map_version;
}

}  // namespace stillmap
