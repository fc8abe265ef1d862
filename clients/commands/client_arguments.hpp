#pragma once

#include <string>

#include "clients/client.hpp"
#include "clients/terminal/command_line.hpp"

namespace stillmap {

/// How a command line names the server to talk to.
struct ClientArguments {
  std::uint32_t domain = 0;
  std::string interface;
  std::string server_name = "stillmap";
  bool udp_only = false;
  /// Folder of our identity in a secured domain; empty: no security.
  std::string security;
  double timeout_s = 10.0;

  [[nodiscard]] std::chrono::milliseconds timeout() const;
  [[nodiscard]] DdsOptions dds() const;
  [[nodiscard]] ClientOptions client() const;
};

/// Adds --domain (else from ROS_DOMAIN_ID), --interface, --udp-only, --security
/// (else from STILLMAP_SECURITY), --server and --timeout.
void add_client_options(CommandHandle command, ClientArguments& arguments);

/// A client whose server answers. Throws ServiceTimeout after the timeout.
[[nodiscard]] Client connect(const ClientArguments& arguments);

}  // namespace stillmap
