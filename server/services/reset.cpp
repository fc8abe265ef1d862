#include "server/services/reset.hpp"

namespace stillmap::server {

stillmap_msgs::srv::Reset_Response reset(const ServiceContext& context,
                                         const stillmap_msgs::srv::Reset_Request& request) {
  using Response = stillmap_msgs::srv::Reset_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const std::uint64_t map_id = context.reset();
    response.status(wire::to_reply_status(wire::ReplyCode::ok, {}, 0, map_id));
  });
}

}  // namespace stillmap::server
