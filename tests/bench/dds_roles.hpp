#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/loaders/dds_profile.hpp"
#include "idl/dds/service_server.hpp"
#include "stillmap_msgs.h"

namespace stillmap::bench {

/// A kind of network that one machine can play, and what is said on top of its profile.
struct Network {
  std::string name;
  DdsNetworkConfig choice;
  DdsNetworkConfig client_choice;
};

/// host, lan over loopback UDP, wifi's settings over loopback UDP, and wan's TCP.
[[nodiscard]] std::vector<Network> networks();

/// The options of one end. All of a run share a domain.
[[nodiscard]] dds::DdsOptions options_of(const Network& network, DdsRole role,
                                         std::uint32_t domain_id);

/// Answers `is_connected`.
using IsConnectedService = dds::ServiceServer<stillmap_msgs::srv::GetStatus_Request,
                                              stillmap_msgs::srv::GetStatus_Response>;
[[nodiscard]] std::unique_ptr<IsConnectedService> confirm_connections(
    dds::Participant& participant);

/// A client's participant; over TCP one to whom the server's process has answered, as Client is.
[[nodiscard]] std::unique_ptr<dds::Participant> join(const dds::DdsOptions& options);

/// A subscriber process: prints each scan's latency [ms], a line each. Ends with the last scan, or
/// a second after nothing comes any more.
void subscribe(const dds::DdsOptions& options);

/// A server process that answers region queries with as many voxels as they ask bytes for, until
/// its standard input ends.
void answer(const dds::DdsOptions& options);

}  // namespace stillmap::bench
