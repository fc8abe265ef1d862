#include "server/services/get_traversable_area.hpp"

#include "core/map/query/region.hpp"
#include "idl/conversions/traversability_query.hpp"

namespace stillmap::server {

stillmap_msgs::srv::GetTraversableArea_Response get_traversable_area(
    const ServiceContext& context, const stillmap_msgs::srv::GetTraversableArea_Request& request) {
  using Response = stillmap_msgs::srv::GetTraversableArea_Response;
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

}  // namespace stillmap::server
