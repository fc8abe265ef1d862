#pragma once

#include <optional>
#include <string>

#include "idl/dds/remote_participant.hpp"

namespace stillmap::dds {

/// DDS name of the topic where ROS 2 nodes announce their endpoints.
inline constexpr const char* ros_discovery_topic = "ros_discovery_info";
/// DDS name of its type, of which there are two layouts: peers of both may be in one domain, so its
/// samples are handled as bytes.
inline constexpr const char* ros_discovery_type =
    "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Length of an endpoint's id in such an announcement: 24 bytes up to ROS 2 Humble, 16 from Iron
/// on. Topic and type have the same names, so who reads the other layout reads nonsense.
enum class RosGids { of_24_bytes, of_16_bytes, any };

/// User data of our own readers of announcements, which understand both.
inline constexpr const char* any_gids_user_data = "stillmap_gids=any;";

/// Which layout this endpoint reads: from Iron on, ROS 2 announces type hashes. Nothing for an
/// endpoint that reads no announcements.
[[nodiscard]] std::optional<RosGids> gids_read_by(const Endpoint& endpoint);

}  // namespace stillmap::dds
