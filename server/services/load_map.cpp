#include "server/services/load_map.hpp"

namespace stillmap::server {

stillmap_msgs::srv::LoadMap_Response load_map(const ServiceContext& context,
                                              const stillmap_msgs::srv::LoadMap_Request& request) {
  using Response = stillmap_msgs::srv::LoadMap_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto file = context.saver.resume_from(request.file(), context.load);
    const auto view = context.latest_map.view();
    response.status(reply_status(*view));
    response.file(file.string());
    response.tile_count(view->tiles.size());
    response.pose_count(context.latest_map.trajectory().size());
  });
}

}  // namespace stillmap::server
