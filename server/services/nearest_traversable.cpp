#include "server/services/nearest_traversable.hpp"

#include "idl/conversions/path_query.hpp"

namespace stillmap {

stillmap_msgs::srv::NearestTraversable_Response nearest_traversable(
    const ServiceContext& context, const stillmap_msgs::srv::NearestTraversable_Request& request) {
  using Response = stillmap_msgs::srv::NearestTraversable_Response;
  return answer<Response>(context, request, [&](const MapView&, Response& response) {
    const auto view = context.areas.view(request.profile());
    NearestTraversable nearest =
        nearest_traversable(*view, {request.x(), request.y()}, request.max_distance_m());
    nearest.map_version = view->version;
    response = wire::to_response(nearest, view->map_id);
  });
}

}  // namespace stillmap
