#include "server/services/get_tile_versions.hpp"

#include <string>

#include "idl/conversions/tile.hpp"

namespace stillmap::server {
namespace {

/// Also refuses NaN, which compares as false.
void check_interval(double low, double high, const std::string& axis) {
  if (low <= high) return;
  throw std::invalid_argument("min_" + axis + " " + std::to_string(low) + " is not <= max_" + axis +
                              " " + std::to_string(high));
}

bool meets(std::int32_t index, double tile_size_m, double low, double high) {
  return index * tile_size_m <= high && (index + 1.0) * tile_size_m >= low;
}

}  // namespace

stillmap_msgs::srv::GetTileVersions_Response get_tile_versions(
    const ServiceContext& context, const stillmap_msgs::srv::GetTileVersions_Request& request) {
  using Response = stillmap_msgs::srv::GetTileVersions_Response;
  return answer<Response>(context, request, [&](const MapSnapshot& view, Response& response) {
    check_interval(request.min_x(), request.max_x(), "x");
    check_interval(request.min_y(), request.max_y(), "y");
    const dds::MapIdentity identity = wire::identity_of(view);
    response.identity(wire::to_wire(identity));
    for (const auto& tile : view.tiles) {
      const TileId id = tile->info.id;
      if (meets(id.x, view.tile_size_m, request.min_x(), request.max_x()) &&
          meets(id.y, view.tile_size_m, request.min_y(), request.max_y())) {
        response.tiles().push_back(wire::to_wire(tile->info, identity));
      }
    }
  });
}

}  // namespace stillmap::server
