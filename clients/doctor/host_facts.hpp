#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "idl/dds/shared_memory_segments.hpp"

namespace stillmap::cli {

struct NetworkInterface {
  std::string name;
  bool is_up = false;
  bool is_loopback = false;
  bool has_multicast = false;
};

/// What this machine gives to DDS.
struct HostFacts {
  std::string name;
  std::uint32_t user = 0;
  /// net.core.rmem_max; nothing where it cannot be read.
  std::optional<std::uint32_t> max_receive_buffer_bytes;
  /// Why /dev/shm cannot be used; empty when it can.
  std::string shared_memory_fault;
  std::vector<dds::SharedMemorySegment> segments;
  std::vector<NetworkInterface> interfaces;
  /// Some route takes multicast packets.
  bool has_multicast_route = false;
  /// Local UDP ports in use, but those of a doctor that listens to all domains meanwhile.
  std::vector<std::uint16_t> udp_ports;
};

/// Reads /proc, /sys and /dev/shm under `root`: "/" for the machine itself.
[[nodiscard]] HostFacts read_host_facts(const std::filesystem::path& root);

}  // namespace stillmap::cli
