#pragma once

#include <string>
#include <string_view>

namespace stillmap::dds {

/// The definition of a message, or of half of a service, as rosbag2, MCAP and Foxglove carry it
/// ("ros2msg"): its .msg text, then those of all types that it uses, each under a line of "=" and
/// one as "MSG: std_msgs/Header". `ros_type` as "nav_msgs/msg/Odometry" (see ros_type_name) or
/// "stillmap_msgs/srv/Reset_Request". Empty for a type that idl/msg does not define.
[[nodiscard]] std::string message_definition(std::string_view ros_type);

}  // namespace stillmap::dds
