#pragma once

#include "server/services/service_context.hpp"

namespace stillmap::server {

/// Tiles by id, up to a few megabytes an answer.
[[nodiscard]] stillmap_msgs::srv::GetTiles_Response get_tiles(
    const ServiceContext& context, const stillmap_msgs::srv::GetTiles_Request& request);

}  // namespace stillmap::server
