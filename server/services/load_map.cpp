#include "server/services/load_map.hpp"

namespace stillmap {

stillmap_msgs::srv::LoadMap_Response load_map(const ServiceContext& context,
                                              const stillmap_msgs::srv::LoadMap_Request& request) {
  using Response = stillmap_msgs::srv::LoadMap_Response;
  return answer<Response>(context, request, [&](const MapView&, Response& response) {
    const auto file = context.saver.go_on_in(request.file(), context.load);
    const auto view = context.board.view();
    response.status(reply_status(*view));
    response.file(file.string());
    response.tile_count(view->tiles.size());
    response.pose_count(context.board.trajectory().size());
  });
}

}  // namespace stillmap
