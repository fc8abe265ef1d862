#include "clients/doctor/host_facts.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <system_error>

#include "core/process/host_name.hpp"

namespace stillmap::cli {
namespace {

namespace fs = std::filesystem;

/// Why nothing can be written there; empty when it can.
std::string write_fault(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) return folder.string() + " does not exist";
  if (::access(folder.c_str(), W_OK | X_OK) == 0) return {};
  const std::string reason = std::strerror(errno);
  return folder.string() + ": " + reason;
}

std::optional<std::uint32_t> number_in(const fs::path& file) {
  std::ifstream in(file);
  std::uint32_t value = 0;
  if (in >> value) return value;
  return std::nullopt;
}

NetworkInterface interface_at(const fs::path& folder) {
  std::ifstream in(folder / "flags");
  unsigned flags = 0;
  in >> std::hex >> flags;
  return {.name = folder.filename().string(),
          .is_up = (flags & IFF_UP) != 0,
          .is_loopback = (flags & IFF_LOOPBACK) != 0,
          .has_multicast = (flags & IFF_MULTICAST) != 0};
}

std::vector<NetworkInterface> interfaces_in(const fs::path& folder) {
  std::vector<NetworkInterface> interfaces;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_directory()) interfaces.push_back(interface_at(entry.path()));
  }
  std::ranges::sort(interfaces, {}, &NetworkInterface::name);
  return interfaces;
}

// Lines of /proc/net/route: interface, destination, gateway, four numbers, mask; addresses as the
// machine holds them, in hexadecimal.
bool takes_multicast(const fs::path& route_file) {
  const std::uint32_t group = inet_addr("239.255.0.1");
  std::ifstream in(route_file);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string interface, skipped;
    std::uint32_t destination = 0, mask = 0;
    words >> interface >> std::hex >> destination >> skipped >> skipped >> skipped >> skipped >>
        skipped >> mask;
    if (words && (group & mask) == destination) return true;
  }
  return false;
}

// Lines of /proc/net/udp: number, address:port in hexadecimal, and more. Participants have their
// port on an address of their own, too, or on all; on 239.255.0.1 alone is a doctor, which listens
// to all domains at once: another one would look for servers where it is.
std::vector<std::uint16_t> ports_in(const fs::path& udp_file) {
  std::vector<std::uint16_t> ports;
  std::ifstream in(udp_file);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string number, local;
    words >> number >> local;
    const std::size_t colon = local.find(':');
    if (colon == std::string::npos || local.starts_with("0100FFEF:")) continue;
    ports.push_back(static_cast<std::uint16_t>(std::stoul(local.substr(colon + 1), nullptr, 16)));
  }
  return ports;
}

}  // namespace

HostFacts read_host_facts(const fs::path& root) {
  return {.name = host_name(),
          .user = ::geteuid(),
          .max_receive_buffer_bytes = number_in(root / "proc/sys/net/core/rmem_max"),
          .shared_memory_fault = write_fault(root / "dev/shm"),
          .segments = dds::shared_memory_segments(root / "dev/shm"),
          .interfaces = interfaces_in(root / "sys/class/net"),
          .has_multicast_route = takes_multicast(root / "proc/net/route"),
          .udp_ports = ports_in(root / "proc/net/udp")};
}

}  // namespace stillmap::cli
