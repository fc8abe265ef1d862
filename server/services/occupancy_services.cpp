#include "server/services/occupancy_services.hpp"

#include <utility>

#include "idl/conversions/octomap.hpp"
#include "server/services/query_occupancy.hpp"

namespace stillmap::server {

OccupancyServices::OccupancyServices(dds::Participant& participant, const dds::Services& names,
                                     ServiceContext context, const OccupancyThread* occupancy,
                                     std::string map_frame)
    : context_(std::move(context)),
      occupancy_(occupancy),
      map_frame_(std::move(map_frame)),
      octomap_binary_(participant, names.octomap_binary,
                      logged(context_.log, names.octomap_binary,
                             [this](const auto&) { return octomap(true); })),
      octomap_full_(
          participant, names.octomap_full,
          logged(context_.log, names.octomap_full, [this](const auto&) { return octomap(false); })),
      query_occupancy_(participant, names.query_occupancy,
                       logged(context_.log, names.query_occupancy, [this](const auto& request) {
                         return query_occupancy(context_, occupancy_, request);
                       })) {}

octomap_msgs::srv::GetOctomap_Response OccupancyServices::octomap(bool binary) const {
  octomap_msgs::srv::GetOctomap_Response response;
  if (occupancy_ == nullptr) return response;
  const EncodedOctree octree = occupancy_->encode(binary);
  response.map(wire::to_octomap(octree.data, octree.stamp_ns, map_frame_));
  return response;
}

}  // namespace stillmap::server
