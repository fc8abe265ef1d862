#include "idl/conversions/traversability.hpp"

#include "core/map/query/region.hpp"
#include "idl/conversions/path_query.hpp"
#include "server/services/service_handlers.hpp"

namespace stillmap::server {

using namespace stillmap_msgs::srv;

namespace {

/// Boxes that hold the region, for an answer that names its faults where it has any.
std::vector<Eigen::AlignedBox2d> boxes_round(const Region& region) {
  if (!region_faults(region).empty()) return {Eigen::AlignedBox2d(Eigen::Vector2d(0.0, 0.0))};
  if (const auto* corridor = std::get_if<CorridorRegion>(&region))
    return boxes_along(corridor->path_map, corridor->half_width_m);
  const Eigen::AlignedBox3d bounds = RegionShape(region).bounds_map();
  return {{Eigen::Vector2d(bounds.min().head<2>()), Eigen::Vector2d(bounds.max().head<2>())}};
}

}  // namespace

GetTraversableArea_Response get_traversable_area(const ServiceContext& context,
                                                 const GetTraversableArea_Request& request) {
  using Response = GetTraversableArea_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    const auto view = context.traversability.view(query->profile, boxes_round(query->region));
    response = wire::to_response(query_traversability(*view, *query));
  });
}

CheckPath_Response check_path(const ServiceContext& context, const CheckPath_Request& request) {
  using Response = CheckPath_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    // Farther than any robot's footprint reaches from the path.
    constexpr double reach_m = 10.0;
    const auto view =
        context.traversability.view(query->profile, boxes_along(query->positions_map, reach_m));
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
