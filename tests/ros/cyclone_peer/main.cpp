// A program of another DDS vendor's (Eclipse Cyclone DDS), which knows Stillmap only by the types
// that ROS 2's generators would make of config/ros/stillmap_msgs and of ROS 2's own messages.

#include <cstdlib>
#include <exception>
#include <iostream>
#include <map>
#include <string>

#include "tests/ros/cyclone_peer/commands.hpp"

namespace {

using stillmap::peer::ServerAddress;

// On this machine only, and without multicast, which containers may lack.
constexpr auto loopback = R"(<CycloneDDS><Domain>
  <General><AllowMulticast>false</AllowMulticast>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>40</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>)";

int run(const std::string& command, const ServerAddress& address, const std::string& argument) {
  using namespace stillmap::peer;
  if (command == "drive") return play_sequence(address, argument);
  if (command == "late") return join_late(address);
  if (command == "graph") return watch_graph(address, argument);
  if (command == "services") return ask_services(address);
  if (command == "clients") return churn_clients(address, std::stoi(argument));
  if (command == "large") return churn_clients_of_large_replies(address, std::stoi(argument));
  throw std::invalid_argument("no command " + command);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "usage: cyclone_peer drive|late|graph|services|clients|large DOMAIN "
                 "[RECORDING|NODE|COUNT]\n";
    return 2;
  }
  setenv("CYCLONEDDS_URI", loopback, 0);
  try {
    std::cout << std::boolalpha;
    const ServerAddress address{.domain_id = static_cast<std::uint32_t>(std::stoul(argv[2]))};
    return run(argv[1], address, argc > 3 ? argv[3] : "");
  } catch (const std::exception& error) {
    std::cerr << "cyclone_peer: " << error.what() << "\n";
    return 1;
  }
}
