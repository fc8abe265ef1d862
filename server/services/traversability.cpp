#include "idl/conversions/traversability.hpp"

#include "core/map/query/region.hpp"
#include "idl/conversions/path_query.hpp"
#include "server/services/service_handlers.hpp"

namespace stillmap::server {

using namespace stillmap_msgs::srv;

GetTraversableArea_Response get_traversable_area(const ServiceContext& context,
                                                 const GetTraversableArea_Request& request) {
  using Response = GetTraversableArea_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    // A region with faults is answered with them.
    Eigen::AlignedBox2d box_map(Eigen::Vector2d(0.0, 0.0));
    if (region_faults(query->region).empty()) {
      const Eigen::AlignedBox3d bounds = RegionShape(query->region).bounds_map();
      box_map = {Eigen::Vector2d(bounds.min().head<2>()), Eigen::Vector2d(bounds.max().head<2>())};
    }
    response = wire::to_response(
        query_traversability(*context.traversability.view(query->profile, box_map), *query));
  });
}

CheckPath_Response check_path(const ServiceContext& context, const CheckPath_Request& request) {
  using Response = CheckPath_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    // Farther than any robot's footprint reaches from the path.
    constexpr double reach_m = 10.0;
    Eigen::AlignedBox2d box_map;
    for (const Eigen::Vector2d& position : query->positions_map) {
      if (position.allFinite()) box_map.extend(position);
    }
    if (box_map.isEmpty()) box_map.extend(Eigen::Vector2d(0.0, 0.0));
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(reach_m);
    const auto view =
        context.traversability.view(query->profile, {box_map.min() - reach, box_map.max() + reach});
    PathCheck check = check_path(*view, *query);
    check.map_version = view->version;
    response = wire::to_response(check, view->map_id);
  });
}

NearestTraversable_Response nearest_traversable(const ServiceContext& context,
                                                const NearestTraversable_Request& request) {
  using Response = NearestTraversable_Response;
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

nav_msgs::srv::GetMap_Response get_map(const ServiceContext& context,
                                       const nav_msgs::srv::GetMap_Request&) {
  nav_msgs::srv::GetMap_Response response;
  response.map(context.grid_provider.message(context.grid_provider.grid()));
  return response;
}

}  // namespace stillmap::server
