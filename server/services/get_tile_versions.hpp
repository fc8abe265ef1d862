#pragma once

#include "server/services/service_context.hpp"

namespace stillmap::server {

/// Revision and hash of every tile whose footprint meets a box.
[[nodiscard]] stillmap_msgs::srv::GetTileVersions_Response get_tile_versions(
    const ServiceContext& context, const stillmap_msgs::srv::GetTileVersions_Request& request);

}  // namespace stillmap::server
