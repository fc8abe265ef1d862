#include "server/services/query_occupancy.hpp"

#include "idl/conversions/occupancy_query.hpp"

namespace stillmap::server {

stillmap_msgs::srv::QueryOccupancy_Response query_occupancy(
    const ServiceContext& context, const OccupancyThread* occupancy,
    const stillmap_msgs::srv::QueryOccupancy_Request& request) {
  using Response = stillmap_msgs::srv::QueryOccupancy_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    if (occupancy == nullptr) {
      throw std::runtime_error(
          "this server keeps no octree: its configuration has occupancy.enabled false");
    }
    wire::write_answers(occupancy->answer(wire::from_request(request)), response);
  });
}

}  // namespace stillmap::server
