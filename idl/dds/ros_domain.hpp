#pragma once

#include <cstdint>

namespace stillmap::dds {

/// The domain that ROS_DOMAIN_ID names, as all commands and ROS 2 nodes take it; 0 where it is not
/// set or empty. Throws DdsError for what is no domain.
[[nodiscard]] std::uint32_t ros_domain_id();

}  // namespace stillmap::dds
