#pragma once

#include "server/services/service_context.hpp"
#include "traversable_area.h"

namespace stillmap::server {

/// The free cell nearest to a place.
[[nodiscard]] stillmap_msgs::srv::NearestTraversable_Response nearest_traversable(
    const ServiceContext& context, const stillmap_msgs::srv::NearestTraversable_Request& request);

}  // namespace stillmap::server
