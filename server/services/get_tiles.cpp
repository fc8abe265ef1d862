#include "server/services/get_tiles.hpp"

#include "idl/conversions/tile.hpp"

namespace stillmap::server {
namespace {

// About 5 MB at 27 bytes a voxel. At least one tile is always sent.
constexpr std::size_t max_voxels_per_reply = 200'000;

}  // namespace

stillmap_msgs::srv::GetTiles_Response get_tiles(
    const ServiceContext& context, const stillmap_msgs::srv::GetTiles_Request& request) {
  using Response = stillmap_msgs::srv::GetTiles_Response;
  return answer<Response>(context, request, [&](const MapSnapshot& view, Response& response) {
    const dds::MapIdentity identity = wire::identity_of(view);
    response.identity(wire::to_wire(identity));
    std::size_t voxels = 0;
    for (const auto& id : request.ids()) {
      const auto known = find_tile(view, {id.x(), id.y()});
      if (known == nullptr) {
        response.missing().push_back(id);
      } else if (voxels > 0 && voxels + known->info.voxel_count > max_voxels_per_reply) {
        response.left_out().push_back(id);
      } else {
        voxels += known->info.voxel_count;
        response.tiles().push_back(wire::to_wire(*context.tiles.read(known), identity));
      }
    }
  });
}

}  // namespace stillmap::server
