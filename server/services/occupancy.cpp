#include "idl/conversions/occupancy.hpp"

#include "server/services/service_handlers.hpp"

namespace stillmap::server {

using namespace stillmap_msgs::srv;

namespace {

octomap_msgs::srv::GetOctomap_Response octomap(const ServiceContext& context,
                                               OctomapEncoding encoding) {
  octomap_msgs::srv::GetOctomap_Response response;
  if (!context.encode_octomap) return response;
  try {
    const EncodedOctree octree = context.encode_octomap(encoding);
    response.map(wire::to_octomap(octree.data, octree.stamp_ns, context.map_frame));
  } catch (const OctreeNotMade&) {
    // The standard's reply has no place for a reason; one without a name is none.
  }
  return response;
}

}  // namespace

octomap_msgs::srv::GetOctomap_Response octomap_binary(
    const ServiceContext& context, const octomap_msgs::srv::GetOctomap_Request&) {
  return octomap(context, OctomapEncoding::binary);
}

octomap_msgs::srv::GetOctomap_Response octomap_full(const ServiceContext& context,
                                                    const octomap_msgs::srv::GetOctomap_Request&) {
  return octomap(context, OctomapEncoding::full);
}

QueryOccupancy_Response query_occupancy(const ServiceContext& context,
                                        const QueryOccupancy_Request& request) {
  using Response = QueryOccupancy_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    if (!context.query_occupancy) {
      throw std::runtime_error(
          "this server keeps no octree: its configuration has occupancy.enabled false");
    }
    wire::write_answers(context.query_occupancy(wire::from_request(request)), response);
  });
}

}  // namespace stillmap::server
