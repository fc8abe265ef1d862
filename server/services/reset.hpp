#pragma once

#include "server/services/service_context.hpp"

namespace stillmap::server {

/// Forgets poses and map.
[[nodiscard]] stillmap_msgs::srv::Reset_Response reset(
    const ServiceContext& context, const stillmap_msgs::srv::Reset_Request& request);

}  // namespace stillmap::server
