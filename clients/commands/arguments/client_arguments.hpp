#pragma once

#include <string>

#include "clients/library/client.hpp"
#include "clients/terminal/command_line.hpp"
#include "config/loaders/dds_profile.hpp"

namespace stillmap::cli {

/// How a command line names the server to talk to.
struct ClientArguments {
  std::uint32_t domain = 0;
  std::string server_name = "stillmap";
  bool udp_only = false;
  DdsNetworkConfig network;
  /// Folder of our identity in a secured domain; empty: no security.
  std::string security;
  double timeout_s = 10.0;

  [[nodiscard]] std::chrono::milliseconds timeout() const;
  /// Throws ConfigError for a profile or an address that cannot be used.
  [[nodiscard]] dds::DdsOptions dds(DdsRole role) const;
  [[nodiscard]] ClientOptions client() const;
};

/// Adds --dds-profile, --interface, --peer and --discovery-server, and their environment variables.
void add_network_options(CommandHandle command, DdsNetworkConfig& network);

/// Adds --domain (else from ROS_DOMAIN_ID), --dds-profile with what overrides it, --security (else
/// from STILLMAP_SECURITY), --server and --timeout.
void add_client_options(CommandHandle command, ClientArguments& arguments);

/// A client whose server answers. Throws ServiceTimeout after the timeout.
[[nodiscard]] Client connect(const ClientArguments& arguments);

}  // namespace stillmap::cli
