#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace stillmap {

/// How a process takes part in a DDS domain. The defaults suit one machine or a quiet network.
struct DdsOptions {
  /// DDS domain, 0..232; ROS 2 calls it ROS_DOMAIN_ID.
  std::uint32_t domain_id = 0;
  /// Shared memory between processes of one machine. Processes of different users, or containers
  /// with separate /dev/shm, do not see each other through it: switch it off there.
  bool shared_memory = true;
  /// Addresses of the network interfaces to use ("127.0.0.1" keeps everything on this machine);
  /// empty means all of them.
  std::vector<std::string> interfaces;
  /// Asked of the kernel for each UDP socket; net.core.rmem_max caps it.
  std::uint32_t socket_buffer_bytes = 4U << 20U;
  /// Name of the participant, and of the node that ROS 2 tools show; empty: no ROS 2 node.
  std::string node_name;
  /// Length of a GID in ros_discovery_info: 24 up to ROS 2 Humble, 16 from Iron.
  std::uint32_t ros_gid_bytes = 24;
  /// Folder of the identity that this process has in a secured domain; empty: no security.
  std::filesystem::path security;
};

}  // namespace stillmap
