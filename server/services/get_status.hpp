#pragma once

#include "server/services/service_context.hpp"

namespace stillmap::server {

/// The status as it is now.
[[nodiscard]] stillmap_msgs::srv::GetStatus_Response get_status(
    const ServiceContext& context, const stillmap_msgs::srv::GetStatus_Request& request);

}  // namespace stillmap::server
