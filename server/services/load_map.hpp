#pragma once

#include "server/services/service_context.hpp"

namespace stillmap::server {

[[nodiscard]] stillmap_msgs::srv::LoadMap_Response load_map(
    const ServiceContext& context, const stillmap_msgs::srv::LoadMap_Request& request);

}  // namespace stillmap::server
