#pragma once

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <string>
#include <vector>

#include "idl/dds/dds_options.hpp"

namespace stillmap::dds {

/// Sets how the participant finds others and is found: by multicast, at known addresses, or through
/// a discovery server. Throws DdsError for the name of a host that cannot be found; returns those
/// of peers where these are allowed.
[[nodiscard]] std::vector<std::string> set_discovery(
    const DdsOptions& options, eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Whether a discovery server tells a participant of others, by these options or by
/// ROS_DISCOVERY_SERVER, which Fast DDS reads: only of who has endpoints that match its own.
[[nodiscard]] bool is_told_by_discovery_server(const DdsOptions& options);

}  // namespace stillmap::dds
