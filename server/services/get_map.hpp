#pragma once

#include "nav_msgs.h"
#include "server/services/service_context.hpp"

namespace stillmap::server {

/// The traversability grid as Nav2 asks for maps; of no size when there is none.
[[nodiscard]] nav_msgs::srv::GetMap_Response get_map(const ServiceContext& context);

}  // namespace stillmap::server
