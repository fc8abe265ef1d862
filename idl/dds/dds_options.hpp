#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace stillmap::dds {

/// The largest domain whose ports fit into 16 bits.
inline constexpr std::uint32_t max_domain_id = 232;

/// What carries data from machine to machine. TCP passes firewalls and lossy long links; it needs
/// the address of one side.
enum class NetworkTransport { udp, tcp };

/// A host by IPv4 address or name. Port 0 is the usual one, or usual ones, of whatever is meant.
struct NetworkAddress {
  std::string host;
  std::uint16_t port = 0;
  friend bool operator==(const NetworkAddress&, const NetworkAddress&) = default;
};

/// How a process takes part in a DDS domain. The defaults suit one machine or a quiet network; for
/// others there are profiles (config/loaders/dds_profile.hpp).
struct DdsOptions {
  /// DDS domain, 0..max_domain_id; ROS 2 calls it ROS_DOMAIN_ID.
  std::uint32_t domain_id = 0;
  NetworkTransport transport = NetworkTransport::udp;
  /// The one port to be reached at, for firewalls and for peers that name it. 0: over UDP the ports
  /// that DDS counts from domain and process, over TCP none: this process connects to others.
  std::uint16_t listening_port = 0;
  /// Shared memory between processes of one machine. Processes of different users, or containers
  /// with separate /dev/shm, do not see each other through it: switch it off there.
  bool shared_memory = true;
  /// Room for messages under way to other processes of this machine.
  std::uint32_t shared_memory_mib = 64;
  /// Find peers by UDP multicast. Off: only by `peers`, shared memory or the discovery server, on
  /// this machine always.
  bool multicast = true;
  /// Addresses of the network interfaces to use ("127.0.0.1" keeps everything on this machine);
  /// empty means all of them.
  std::vector<std::string> interfaces;
  /// Where to look for other processes, beside or instead of multicast. One of two
  /// processes needs to list the other.
  std::vector<NetworkAddress> peers;
  /// Join without peers whose name no address is known for (Participant::unresolved_peers()): they
  /// may list us. Otherwise that is an error.
  bool unresolved_peers_allowed = false;
  /// The discovery server to register with; empty host: none.
  NetworkAddress discovery_server;
  /// Be the discovery server on this port; 0: be none.
  std::uint16_t discovery_port = 0;
  /// Asked of the kernel for each UDP socket; net.core.rmem_max caps it.
  std::uint32_t socket_buffer_bytes = 4U << 20U;
  /// Larger samples go out in fragments of this size. Below the link's MTU (1472 on Ethernet), a
  /// lost packet costs one fragment instead of 64 KB.
  std::uint32_t max_datagram_bytes = 65500;
  /// How often a reliable writer tells what it has sent, so that losses are noticed.
  std::uint32_t heartbeat_ms = 50;
  /// How long losses are collected before they are requested, and again before they are resent.
  std::uint32_t repair_delay_ms = 5;
  /// A process that was silent for so long is removed and must be discovered anew: longer than
  /// outages that shall not matter, at least 3.
  std::uint32_t lease_s = 10;
  /// Limit for all large messages that this process sends: tiles, clouds, grids and large answers,
  /// to all receivers together, repairs included. Poses and the status overtake them. 0: no limit.
  std::uint32_t large_message_bytes_per_s = 0;
  /// Name of the participant, and of the node that ROS 2 tools show; empty: no ROS 2 node.
  std::string node_name;
  /// Name of a participant without a node.
  std::string participant_name = "stillmap";
  /// Folder of the identity that this process has in a secured domain; empty: no security.
  std::filesystem::path security;
};

}  // namespace stillmap::dds
