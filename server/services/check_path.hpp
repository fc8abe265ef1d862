#pragma once

#include "server/services/service_context.hpp"
#include "traversable_area.h"

namespace stillmap::server {

/// Whether a robot can follow a path, or the first place where it cannot.
[[nodiscard]] stillmap_msgs::srv::CheckPath_Response check_path(
    const ServiceContext& context, const stillmap_msgs::srv::CheckPath_Request& request);

}  // namespace stillmap::server
