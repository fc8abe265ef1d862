#pragma once

#include "server/services/service_context.hpp"

namespace stillmap::server {

/// Saves the map now.
[[nodiscard]] stillmap_msgs::srv::SaveMap_Response save_map(
    const ServiceContext& context, const stillmap_msgs::srv::SaveMap_Request& request);

}  // namespace stillmap::server
