#include <algorithm>
#include <charconv>
#include <exception>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/map/voxel_grid.hpp"
#include "idl/conversions/tile.hpp"
#include "server/services/service_handlers.hpp"

namespace stillmap::server {

using namespace stillmap_msgs::srv;

namespace {

/// The map that a page shows: that of the answer's first page, else the newest. A page after the
/// first needs no history.
MapState state_for(const ServiceContext& context, const MapQuery& query) {
  const auto map = continued_map(query.continuation);
  auto view = map ? context.paged_snapshots->find(*map) : nullptr;
  return view ? MapState{std::move(view), nullptr} : context.latest_map.state();
}

void update_session(PagedSnapshots& pages, const MapQueryResult& result,
                    const PagedSnapshots::Snapshot& view) {
  const auto now = PagedSnapshots::Clock::now();
  if (result.status == QueryStatus::ok) {
    const bool is_last = result.continuation.empty();
    is_last ? pages.end(view, now) : pages.keep(view, now);
  }
  pages.drop_expired(now);
}

/// Also refuses NaN, which compares as false.
void check_interval(double low, double high, const std::string& axis) {
  if (low <= high) return;
  throw std::invalid_argument("min_" + axis + " " + std::to_string(low) + " is not <= max_" + axis +
                              " " + std::to_string(high));
}

// About 2 MB.
constexpr std::size_t max_versions_per_reply = 20'000;

/// Where a page of tile versions ends: its last tile.
std::string page_end(TileId last) { return std::to_string(last.x) + "," + std::to_string(last.y); }

/// The first tile that may be on the next page. Throws std::invalid_argument for a text that
/// page_end() did not write.
TileId after_page(const std::string& continuation) {
  constexpr std::int32_t lowest = std::numeric_limits<std::int32_t>::min();
  if (continuation.empty()) return {lowest, lowest};
  TileId last;
  const char* const end = continuation.data() + continuation.size();
  const auto x = std::from_chars(continuation.data(), end, last.x);
  const bool has_comma = x.ec == std::errc() && x.ptr != end && *x.ptr == ',';
  const auto y = has_comma ? std::from_chars(x.ptr + 1, end, last.y) : x;
  if (!has_comma || y.ec != std::errc() || y.ptr != end ||
      last.y == std::numeric_limits<std::int32_t>::max()) {
    throw std::invalid_argument(
        "continuation is damaged; hand back the text of the last page as it is");
  }
  return {last.x, last.y + 1};
}

// About 5 MB at 27 bytes a voxel. At least one tile is always sent.
constexpr std::size_t max_voxels_per_reply = 200'000;

}  // namespace

GetStaticMap_Response get_static_map(const ServiceContext& context,
                                     const GetStaticMap_Request& request) {
  using Response = GetStaticMap_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    query->max_bytes = std::min(query->max_bytes, context.max_page_bytes);
    const MapState state = state_for(context, *query);
    const MapQueryResult result =
        query_map(*state.view, *query, state.history.get(), context.tiles);
    update_session(*context.paged_snapshots, result, state.view);
    response = wire::to_response(result);
  });
}

void drop_expired_pages(const ServiceContext& context) {
  context.paged_snapshots->drop_expired(PagedSnapshots::Clock::now());
}

GetTileVersions_Response get_tile_versions(const ServiceContext& context,
                                           const GetTileVersions_Request& request) {
  using Response = GetTileVersions_Response;
  return answer<Response>(context, request, [&](const MapSnapshot& view, Response& response) {
    check_interval(request.min_x(), request.max_x(), "x");
    check_interval(request.min_y(), request.max_y(), "y");
    const dds::MapIdentity identity = wire::identity_of(view);
    response.identity(wire::to_wire(identity));
    const Eigen::AlignedBox3d box_map(Eigen::Vector3d(request.min_x(), request.min_y(), 0.0),
                                      Eigen::Vector3d(request.max_x(), request.max_y(), 0.0));
    const TileRange range = tile_range(box_map, view.tile_size_m);
    auto tiles = tiles_in_range(view.tiles, range, max_versions_per_reply + 1,
                                after_page(request.continuation()));
    if (tiles.size() > max_versions_per_reply) {
      tiles.pop_back();
      response.continuation(page_end(tiles.back()->info.id));
    }
    response.tiles().reserve(tiles.size());
    for (const auto& tile : tiles) {
      response.tiles().push_back(wire::to_wire(tile->info, identity));
    }
  });
}

GetTiles_Response get_tiles(const ServiceContext& context, const GetTiles_Request& request) {
  using Response = GetTiles_Response;
  return answer<Response>(context, request, [&](const MapSnapshot& view, Response& response) {
    const dds::MapIdentity identity = wire::identity_of(view);
    response.identity(wire::to_wire(identity));
    std::size_t voxels = 0;
    std::exception_ptr unreadable;
    for (const auto& id : request.ids()) {
      const auto known = find_tile(view, {id.x(), id.y()});
      if (known == nullptr) {
        response.missing().push_back(id);
      } else if (voxels > 0 && voxels + known->info.voxel_count > max_voxels_per_reply) {
        response.remaining().push_back(id);
      } else {
        try {
          response.tiles().push_back(wire::to_wire(*context.tiles.read(known), identity));
          voxels += known->info.voxel_count;
        } catch (const std::runtime_error&) {
          // Of many tiles, the others are given: its client asks for this one again.
          unreadable = std::current_exception();
        }
      }
    }
    const bool has_others =
        !response.tiles().empty() || !response.missing().empty() || !response.remaining().empty();
    if (unreadable && !has_others) std::rethrow_exception(unreadable);
  });
}

}  // namespace stillmap::server
