#pragma once

#include <string>

#include "idl/dds/service_server.hpp"
#include "idl/interface/topics.hpp"
#include "octomap_msgs.h"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/services/service_context.hpp"
#include "stillmap_occupancy.h"

namespace stillmap::server {

/// What can be asked about the octree, each service on its own thread. `occupancy` may be null:
/// then queries are refused and octomaps have neither name nor data.
class OccupancyServices {
 public:
  OccupancyServices(dds::Participant& participant, const dds::Services& names,
                    ServiceContext context, const OccupancyThread* occupancy,
                    std::string map_frame);

 private:
  [[nodiscard]] octomap_msgs::srv::GetOctomap_Response octomap(bool binary) const;

  ServiceContext context_;
  const OccupancyThread* occupancy_;
  std::string map_frame_;
  using GetOctomap = dds::ServiceServer<octomap_msgs::srv::GetOctomap_Request,
                                        octomap_msgs::srv::GetOctomap_Response>;
  GetOctomap octomap_binary_;
  GetOctomap octomap_full_;
  dds::ServiceServer<stillmap_msgs::srv::QueryOccupancy_Request,
                     stillmap_msgs::srv::QueryOccupancy_Response>
      query_occupancy_;
};

}  // namespace stillmap::server
