#pragma once

#include "server/services/service_context.hpp"
#include "traversable_area.h"

namespace stillmap::server {

/// Where a robot can go in a region: a grid with reasons, and outlines.
[[nodiscard]] stillmap_msgs::srv::GetTraversableArea_Response get_traversable_area(
    const ServiceContext& context, const stillmap_msgs::srv::GetTraversableArea_Request& request);

}  // namespace stillmap::server
