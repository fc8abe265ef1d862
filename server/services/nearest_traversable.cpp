#include "server/services/nearest_traversable.hpp"

#include "idl/conversions/path_query.hpp"

namespace stillmap::server {

stillmap_msgs::srv::NearestTraversable_Response nearest_traversable(
    const ServiceContext& context, const stillmap_msgs::srv::NearestTraversable_Request& request) {
  using Response = stillmap_msgs::srv::NearestTraversable_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const Eigen::Vector2d position(request.x(), request.y());
    const bool is_usable = position.allFinite() && request.max_distance_m() >= 0.0;
    const Eigen::Vector2d reach =
        Eigen::Vector2d::Constant(is_usable ? request.max_distance_m() : 0.0);
    const Eigen::Vector2d centre = is_usable ? position : Eigen::Vector2d(0.0, 0.0);
    const auto view =
        context.traversability.view(request.profile(), {centre - reach, centre + reach});
    NearestTraversable nearest =
        nearest_traversable(*view, {request.x(), request.y()}, request.max_distance_m());
    nearest.map_version = view->version;
    response = wire::to_response(nearest, view->map_id);
  });
}

}  // namespace stillmap::server
