#include "server/services/get_traversable_area.hpp"

#include "idl/conversions/area_query.hpp"

namespace stillmap {

stillmap_msgs::srv::GetTraversableArea_Response get_traversable_area(
    const ServiceContext& context, const stillmap_msgs::srv::GetTraversableArea_Request& request) {
  using Response = stillmap_msgs::srv::GetTraversableArea_Response;
  return answer<Response>(context, request, [&](const MapView&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    response = wire::to_response(answer_area(*context.areas.view(query->profile), *query));
  });
}

}  // namespace stillmap
