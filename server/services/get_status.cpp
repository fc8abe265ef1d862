#include "server/services/get_status.hpp"

#include "idl/conversions/status.hpp"

namespace stillmap::server {

stillmap_msgs::srv::GetStatus_Response get_status(
    const ServiceContext& context, const stillmap_msgs::srv::GetStatus_Request& request) {
  using Response = stillmap_msgs::srv::GetStatus_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    response.server(wire::to_wire(context.status()));
  });
}

}  // namespace stillmap::server
