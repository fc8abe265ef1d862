#include "server/services/save_map.hpp"

namespace stillmap::server {

stillmap_msgs::srv::SaveMap_Response save_map(const ServiceContext& context,
                                              const stillmap_msgs::srv::SaveMap_Request& request) {
  using Response = stillmap_msgs::srv::SaveMap_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    context.publish_now();
    response.status(reply_status(*context.latest_map.view()));
    response.file(context.saver.save_as(request.file()).string());
  });
}

}  // namespace stillmap::server
