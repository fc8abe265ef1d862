#include "idl/dds/discovery.hpp"

#include <arpa/inet.h>
#include <fastrtps/utils/IPLocator.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/qos.hpp"
#include "idl/dds/transports.hpp"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::DomainParticipantQos;
using eprosima::fastrtps::rtps::BuiltinAttributes;
using eprosima::fastrtps::rtps::GuidPrefix_t;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::RemoteServerAttributes;

constexpr const char* this_machine = "127.0.0.1";

/// Nobody knows an IPv4 address of the host.
class UnknownHost : public DdsError {
 public:
  using DdsError::DdsError;
};

std::string ipv4_of(const std::string& host) {
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), nullptr, &wanted, &found);
  if (error != 0) {
    throw UnknownHost("no IPv4 address is known for '" + host + "': " + ::gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, &::freeaddrinfo);
  std::array<char, INET_ADDRSTRLEN> text{};
  const auto* address = reinterpret_cast<const sockaddr_in*>(found->ai_addr);
  ::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
  return text.data();
}

/// Port 0 stands for the usual ones.
Locator_t udp_locator(const NetworkAddress& address) {
  Locator_t locator(address.port);
  locator.kind = LOCATOR_KIND_UDPv4;
  if (!address.host.empty()) IPLocator::setIPv4(locator, ipv4_of(address.host));
  return locator;
}

Locator_t tcp_locator(const NetworkAddress& address) {
  Locator_t locator;
  locator.kind = LOCATOR_KIND_TCPv4;
  IPLocator::setIPv4(locator, ipv4_of(address.host));
  // The logical port stays 0: the usual ones are tried.
  IPLocator::setPhysicalPort(locator, address.port);
  return locator;
}

/// The multicast address where DDS processes of a domain announce themselves.
Locator_t domain_multicast(std::uint32_t domain_id) {
  const auto port = static_cast<std::uint16_t>(7400 + 250 * domain_id);
  return udp_locator({.host = "239.255.0.1", .port = port});
}

/// This process at a port of the interfaces that it may use.
std::vector<Locator_t> own_locators(const DdsOptions& options, std::uint16_t port) {
  std::vector<Locator_t> locators;
  for (const std::string& address : options.interfaces) {
    locators.push_back(udp_locator({.host = address, .port = port}));
  }
  if (locators.empty()) locators.push_back(udp_locator({.host = {}, .port = port}));
  return locators;
}

void set_listening_locators(const DdsOptions& options, DomainParticipantQos& qos) {
  BuiltinAttributes& builtin = qos.wire_protocol().builtin;
  auto& data = qos.wire_protocol().default_unicast_locator_list;
  // Where anything is listed, nothing is added: without multicast addresses, there is none.
  for (const Locator_t& own : own_locators(options, options.listening_port)) {
    builtin.metatrafficUnicastLocatorList.push_back(own);
    if (options.listening_port != 0) data.push_back(own);
  }
  if (options.multicast) {
    builtin.metatrafficMulticastLocatorList.push_back(domain_multicast(options.domain_id));
  }
  if (options.listening_port == 0 || !options.shared_memory) return;
  Locator_t shared_memory;
  shared_memory.kind = LOCATOR_KIND_SHM;
  data.push_back(shared_memory);
}

/// The peers that no address is known for, where these are allowed.
std::vector<std::string> add_initial_peers(const DdsOptions& options, BuiltinAttributes& builtin) {
  const bool tcp = options.transport == NetworkTransport::tcp;
  auto& peers = builtin.initialPeersList;
  std::vector<std::string> unresolved;
  for (const NetworkAddress& peer : options.peers) {
    try {
      peers.push_back(tcp ? tcp_locator(peer) : udp_locator(peer));
    } catch (const UnknownHost&) {
      if (!options.unresolved_peers_allowed) throw;
      unresolved.push_back(peer.host);
    }
  }
  if (tcp) return unresolved;
  if (!options.multicast) peers.push_back(udp_locator({.host = this_machine, .port = 0}));
  // Where peers are listed, multicast is used only when it is listed as well.
  if (options.multicast && !options.peers.empty()) {
    peers.push_back(domain_multicast(options.domain_id));
  }
  return unresolved;
}

/// What ROS 2 and `fastdds discovery` call server 0.
GuidPrefix_t server_prefix() {
  GuidPrefix_t prefix;
  std::istringstream("44.53.00.5f.45.50.52.4f.53.49.4d.41") >> prefix;
  return prefix;
}

void configure_discovery_server(const DdsOptions& options, DomainParticipantQos& qos) {
  BuiltinAttributes& builtin = qos.wire_protocol().builtin;
  qos.wire_protocol().prefix = server_prefix();
  builtin.discovery_config.discoveryProtocol =
      eprosima::fastrtps::rtps::DiscoveryProtocol_t::SERVER;
  for (const Locator_t& own : own_locators(options, options.discovery_port)) {
    builtin.metatrafficUnicastLocatorList.push_back(own);
  }
}

void configure_discovery_client(const NetworkAddress& server, BuiltinAttributes& builtin) {
  RemoteServerAttributes remote;
  remote.guidPrefix = server_prefix();
  remote.metatrafficUnicastLocatorList.push_back(udp_locator(server));
  builtin.discovery_config.discoveryProtocol =
      eprosima::fastrtps::rtps::DiscoveryProtocol_t::CLIENT;
  builtin.discovery_config.m_DiscoveryServers.push_back(remote);
}

bool is_udp_port_used(std::int32_t port) {
  const int probe = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return false;
  sockaddr_in any{};
  any.sin_family = AF_INET;
  any.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool bound = ::bind(probe, reinterpret_cast<const sockaddr*>(&any), sizeof any) == 0;
  const bool used = !bound && errno == EADDRINUSE;
  ::close(probe);
  return used;
}

/// What is known of a participant's ports, from the best to the worst.
enum class Ports {
  /// There is no shared memory of them.
  fresh,
  /// Whoever had them ended by itself, as a rule, while others still have their shared memory open:
  /// these reach who takes it over.
  closed,
  /// Of a living process, which may be this one, or of one that was killed. That one's shared
  /// memory is made anew, and who still has the old one open does not reach the new one.
  taken
};

Ports shared_memory_of(std::int32_t port) {
  const std::string file = "/dev/shm/fastrtps_port" + std::to_string(port);
  std::error_code unreadable;
  // The lock of who listens there.
  if (std::filesystem::exists(file + "_el", unreadable)) return Ports::taken;
  return std::filesystem::exists(file, unreadable) ? Ports::closed : Ports::fresh;
}

Ports ports_of(std::uint32_t domain_id, std::int32_t participant_id) {
  // As the standard maps them: discovery, and data.
  const std::int32_t discovery =
      7400 + 250 * static_cast<std::int32_t>(domain_id) + 10 + 2 * participant_id;
  const std::int32_t data = discovery + 1;
  if (is_udp_port_used(discovery) || is_udp_port_used(data)) return Ports::taken;
  return std::max(shared_memory_of(discovery), shared_memory_of(data));
}

/// By default a process gets the ports of the last one that was killed. Nothing where all are
/// taken.
std::optional<std::int32_t> free_participant_id(std::uint32_t domain_id) {
  // Fast DDS numbers participants without a number from 0; no two of one process may have the same
  // number, not even in different domains.
  constexpr std::uint32_t first = 20;
  // The highest domain's ports end at 65535, those of others where the next domain's begin.
  const std::uint32_t ids = (domain_id == max_domain_id ? 60 : 120) - first;
  // Not the process's number: in containers, all have the same.
  static std::atomic<std::uint32_t> next{std::random_device{}() % ids};
  std::optional<std::int32_t> closed;
  for (std::uint32_t tried = 0; tried < ids; ++tried) {
    // Never the same one twice in a row: two of one process must differ.
    const auto id = static_cast<std::int32_t>(first + next++ % ids);
    const Ports ports = ports_of(domain_id, id);
    if (ports == Ports::fresh) return id;
    if (ports == Ports::closed && !closed) closed = id;
  }
  // Or the next one in another domain would begin, and end, where this one did.
  ++next;
  return closed;
}

}  // namespace

bool is_told_by_discovery_server(const DdsOptions& options) {
  if (!options.discovery_server.host.empty()) return true;
  const char* const servers = std::getenv("ROS_DISCOVERY_SERVER");
  return servers != nullptr && *servers != '\0';
}

std::vector<std::string> set_discovery(const DdsOptions& options, DomainParticipantQos& qos) {
  BuiltinAttributes& builtin = qos.wire_protocol().builtin;
  if (options.discovery_port != 0) {
    configure_discovery_server(options, qos);
    return {};
  }
  const bool udp = options.transport == NetworkTransport::udp;
  // TCP peers look for the domain's first process at a port.
  if (!udp && options.listening_port != 0) qos.wire_protocol().participant_id = 0;
  if (udp && (!options.multicast || options.listening_port != 0)) {
    set_listening_locators(options, qos);
  } else if (udp && options.shared_memory && options.discovery_server.host.empty() &&
             options.node_name.empty()) {
    // A service keeps the usual ports, where processes look for it that list it as a peer.
    const auto id = free_participant_id(options.domain_id);
    if (id) {
      qos.wire_protocol().participant_id = *id;
    } else {
      leave_out_shared_memory(qos);
    }
  }
  if (!options.discovery_server.host.empty()) {
    configure_discovery_client(options.discovery_server, builtin);
    return {};
  }
  return add_initial_peers(options, builtin);
}

}  // namespace stillmap::dds
