#include "server/services/check_path.hpp"

#include "idl/conversions/path_query.hpp"

namespace stillmap {

stillmap_msgs::srv::CheckPath_Response check_path(
    const ServiceContext& context, const stillmap_msgs::srv::CheckPath_Request& request) {
  using Response = stillmap_msgs::srv::CheckPath_Response;
  return answer<Response>(context, request, [&](const MapView&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    const auto view = context.areas.view(query->profile);
    PathCheck check = check_path(*view, *query);
    check.map_version = view->version;
    response = wire::to_response(check, view->map_id);
  });
}

}  // namespace stillmap
