#include <iostream>
#include <memory>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "idl/dds/participant.hpp"

namespace stillmap::cli {
namespace {

struct DiscoveryServerArguments {
  int port = 11811;
  std::uint32_t domain = 0;
  DdsNetworkConfig network;
};

ExitCode run(const DiscoveryServerArguments& arguments) {
  StopSignal stop;
  dds::DdsOptions options = dds_options(arguments.network, DdsRole::client);
  options.domain_id = arguments.domain;
  options.discovery_port = static_cast<std::uint16_t>(arguments.port);
  // It carries no data.
  options.shared_memory = false;
  const dds::Participant discovery_server(options);
  std::cout << "discovery server on UDP port " << arguments.port << std::endl;
  while (!stop.wait_for(std::chrono::seconds(60))) {
  }
  return ExitCode::ok;
}

}  // namespace

void add_discovery_server_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<DiscoveryServerArguments>();
  CommandHandle command = program.command(
      "discovery-server", "Let processes find each other where there is no multicast");
  command.option("--port", arguments->port, "UDP port to listen at")
      .between(1, 65535)
      .with_default();
  command.option("--domain", arguments->domain, "DDS domain of those who register")
      .from_environment("ROS_DOMAIN_ID")
      .between(0, dds::max_domain_id)
      .with_default();
  command
      .option("--interface", arguments->network.interfaces,
              "Use only the network interface with this address")
      .one_at_a_time();
  command.explain(
      "Examples:\n"
      "  stillmap discovery-server\n"
      "  stillmap-server --dds-profile no_multicast --discovery-server 10.0.0.5\n"
      "  ROS_DISCOVERY_SERVER=10.0.0.5:11811 ros2 topic list\n"
      "It carries no data and may run anywhere that all others reach. Ends with Ctrl-C.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
