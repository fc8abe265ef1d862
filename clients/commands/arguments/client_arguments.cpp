#include "clients/commands/arguments/client_arguments.hpp"

#include "config/loaders/topic_name.hpp"

namespace stillmap::cli {

std::chrono::milliseconds ClientArguments::timeout() const {
  return std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * timeout_s));
}

dds::DdsOptions ClientArguments::dds(DdsRole role) const {
  DdsNetworkConfig choice = network;
  if (udp_only) choice.shared_memory = false;
  dds::DdsOptions options = dds_options(choice, role);
  options.domain_id = domain;
  options.security = security;
  return options;
}

ClientOptions ClientArguments::client() const {
  return {.dds = dds(DdsRole::client), .server_name = server_name, .request_timeout = timeout()};
}

void add_network_options(CommandHandle command, DdsNetworkConfig& network) {
  command
      .option("--dds-profile", network.profile,
              "Kind of network: host, lan, wifi, wan, "
              "no_multicast, or a file")
      .from_environment("STILLMAP_DDS_PROFILE")
      .with_default();
  command
      .option("--interface", network.interfaces,
              "Use only the network interface with this address (127.0.0.1: this machine)")
      .one_at_a_time();
  command
      .option("--peer", network.peers,
              "Where to look for the server, as HOST or HOST:PORT, without multicast")
      .from_environment("STILLMAP_PEERS")
      .comma_separated()
      .one_at_a_time();
  command
      .option("--discovery-server", network.discovery_server,
              "Find everybody through the discovery server at HOST or HOST:PORT")
      .from_environment("STILLMAP_DISCOVERY_SERVER");
}

void add_client_options(CommandHandle command, ClientArguments& arguments) {
  command.option("--domain", arguments.domain, "DDS domain of the server")
      .from_environment("ROS_DOMAIN_ID")
      .between(0, dds::max_domain_id)
      .with_default();
  add_network_options(command, arguments.network);
  command.option("--server", arguments.server_name, "First part of the server's topic names")
      .corrected(to_topic_name)
      .with_default();
  command.flag(
      "--udp-only", arguments.udp_only,
      "No shared memory, where the profile has it: the server runs as another user or in a "
      "container");
  command
      .option("--security", arguments.security,
              "Folder of our identity in a secured domain (stillmap security init)")
      .from_environment("STILLMAP_SECURITY");
  constexpr int seconds_of_a_day = 86400;
  command.option("--timeout", arguments.timeout_s, "Longest wait for the server [s]")
      .above_zero_to(seconds_of_a_day)
      .with_default();
}

Client connect(const ClientArguments& arguments) {
  Client client(arguments.client());
  client.wait_for_server(arguments.timeout());
  return client;
}

}  // namespace stillmap::cli
