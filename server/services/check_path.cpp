#include "server/services/check_path.hpp"

#include "idl/conversions/path_query.hpp"

namespace stillmap::server {

stillmap_msgs::srv::CheckPath_Response check_path(
    const ServiceContext& context, const stillmap_msgs::srv::CheckPath_Request& request) {
  using Response = stillmap_msgs::srv::CheckPath_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    // What a robot of any size reaches from the path.
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

}  // namespace stillmap::server
