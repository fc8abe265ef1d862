#pragma once

#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <string>

#include "idl/dds/qos.hpp"

namespace stillmap {

/// DDS names of a ROS 2 service's two topics; `service` as in "stillmap/get_status".
[[nodiscard]] std::string request_topic(const std::string& service);
[[nodiscard]] std::string reply_topic(const std::string& service);

/// What both ends of a service use.
[[nodiscard]] TopicQos service_qos();

/// How long a reply waits for the client's reader to be discovered.
inline constexpr std::chrono::milliseconds reply_match_timeout{500};

/// Identity that a reply carries so that rmw_fastrtps clients find their request again: the
/// request's own, its writer replaced by the client's reply reader where the request names it.
[[nodiscard]] eprosima::fastrtps::rtps::SampleIdentity reply_identity(
    const eprosima::fastdds::dds::SampleInfo& request);

/// True when a request names the reader that its reply is for.
[[nodiscard]] bool names_reply_reader(const eprosima::fastdds::dds::SampleInfo& request);

}  // namespace stillmap
