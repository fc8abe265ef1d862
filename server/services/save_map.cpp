#include "server/services/save_map.hpp"

namespace stillmap {

stillmap_msgs::srv::SaveMap_Response save_map(const ServiceContext& context,
                                              const stillmap_msgs::srv::SaveMap_Request& request) {
  using Response = stillmap_msgs::srv::SaveMap_Response;
  return answer<Response>(context, request, [&](const MapView&, Response& response) {
    context.show_now();
    response.status(reply_status(*context.board.view()));
    response.file(context.saver.save_as(request.file()).string());
  });
}

}  // namespace stillmap
