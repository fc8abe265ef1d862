#pragma once

#include "server/occupancy/occupancy_thread.hpp"
#include "server/services/service_context.hpp"
#include "stillmap_occupancy.h"

namespace stillmap::server {

/// Points, boxes and rays of one request. `occupancy` is null when the server keeps no octree.
[[nodiscard]] stillmap_msgs::srv::QueryOccupancy_Response query_occupancy(
    const ServiceContext& context, const OccupancyThread* occupancy,
    const stillmap_msgs::srv::QueryOccupancy_Request& request);

}  // namespace stillmap::server
