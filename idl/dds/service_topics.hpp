#pragma once

#include <string>

#include "idl/dds/topic_qos.hpp"

namespace stillmap::dds {

/// DDS names of a ROS 2 service's two topics; `service` as in "stillmap/get_status".
[[nodiscard]] std::string request_topic(const std::string& service);
[[nodiscard]] std::string reply_topic(const std::string& service);

/// What both ends of a service use.
[[nodiscard]] TopicQos service_qos();

}  // namespace stillmap::dds
