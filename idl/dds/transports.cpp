#include "idl/dds/transports.hpp"

#include <fastdds/rtps/transport/TCPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/shared_memory_segments.hpp"

namespace stillmap::dds {

using namespace eprosima::fastdds::rtps;

namespace {

constexpr const char* shared_memory_folder = "/dev/shm";

/// Nothing where there is no such folder.
std::optional<std::uint64_t> free_shared_memory_mib() {
  struct statvfs room {};
  if (statvfs(shared_memory_folder, &room) != 0) return std::nullopt;
  return (std::uint64_t{room.f_bavail} * room.f_frsize) >> 20U;
}

/// Without room for it, a process that writes into its segment ends with a bus error. What
/// processes left that were killed goes first: a server that is killed and started again for weeks
/// would else take the machine's memory, 64 MB each time.
void require_shared_memory_room(std::uint64_t segment_mib) {
  // Beside the segment: the ports' queues.
  constexpr std::uint64_t margin_mib = 4;
  constexpr std::chrono::seconds min_age(10);
  const std::uint64_t needed_mib = segment_mib + margin_mib;
  remove_stale_segments(shared_memory_folder, min_age, StaleSegments::without_ports);
  if (free_shared_memory_mib().value_or(needed_mib) >= needed_mib) return;
  throw DdsError(
      "/dev/shm has " + std::to_string(free_shared_memory_mib().value_or(0)) +
      " MiB free, shared memory takes " + std::to_string(needed_mib) +
      ", and of dead processes there is nothing that may be removed: remove other users' "
      "stale /dev/shm/fastrtps_* files, give a container more (docker run "
      "--shm-size 256m), or switch it off with a DDS profile that says shared_memory: "
      "false");
}

// Of a peer without a port, as many processes are looked for.
constexpr std::uint32_t max_participants_per_peer = 16;

bool is_shared_memory(const std::shared_ptr<TransportDescriptorInterface>& transport) {
  return std::dynamic_pointer_cast<SharedMemTransportDescriptor>(transport) != nullptr;
}

std::shared_ptr<TransportDescriptorInterface> udp_transport(const DdsOptions& options) {
  const auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->sendBufferSize = udp->receiveBufferSize = options.socket_buffer_bytes;
  udp->maxMessageSize = options.max_datagram_bytes;
  udp->maxInitialPeersRange = max_participants_per_peer;
  udp->interfaceWhiteList = options.interfaces;
  return udp;
}

/// One that nobody listens at now; 0 when there is none.
std::uint16_t free_tcp_port() {
  const int probe = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  auto* const any_address = reinterpret_cast<sockaddr*>(&address);
  socklen_t length = sizeof address;
  const bool found = probe >= 0 && ::bind(probe, any_address, length) == 0 &&
                     ::getsockname(probe, any_address, &length) == 0;
  if (probe >= 0) ::close(probe);
  return found ? ntohs(address.sin_port) : std::uint16_t{0};
}

/// What tells a participant from all others at its address. Fast DDS would take the process's
/// number: the same one for two participants of a process, and for processes in containers of
/// different machines, whose answers then go to one of them.
std::uint16_t tcp_port_of(const DdsOptions& options) {
  return options.listening_port != 0 ? options.listening_port : free_tcp_port();
}

std::shared_ptr<TransportDescriptorInterface> tcp_transport(const DdsOptions& options) {
  const auto tcp = std::make_shared<TCPv4TransportDescriptor>();
  tcp->sendBufferSize = tcp->receiveBufferSize = options.socket_buffer_bytes;
  tcp->maxMessageSize = options.max_datagram_bytes;
  tcp->interfaceWhiteList = options.interfaces;
  // Each message would wait for the acknowledgement of the one before.
  tcp->enable_tcp_nodelay = true;
  // TCP has checksums of its own.
  tcp->calculate_crc = tcp->check_crc = false;
  if (const std::uint16_t port = tcp_port_of(options); port != 0) tcp->add_listener_port(port);
  return tcp;
}

/// The port at which a socket waits for connections; nothing for other files.
std::optional<std::uint16_t> listening_port_of(int fd) {
  int listens = 0;
  socklen_t length = sizeof listens;
  if (::getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listens, &length) != 0 || listens == 0) {
    return std::nullopt;
  }
  sockaddr_in address{};
  length = sizeof address;
  auto* const any_address = reinterpret_cast<sockaddr*>(&address);
  if (::getsockname(fd, any_address, &length) != 0 || address.sin_family != AF_INET) {
    return std::nullopt;
  }
  return ntohs(address.sin_port);
}

}  // namespace

void set_transports(const DdsOptions& options, eprosima::fastdds::dds::DomainParticipantQos& qos) {
  qos.transport().use_builtin_transports = false;
  auto& transports = qos.transport().user_transports;
  const bool udp = options.transport == NetworkTransport::udp;
  transports.push_back(udp ? udp_transport(options) : tcp_transport(options));
  if (!options.shared_memory) return;
  require_shared_memory_room(options.shared_memory_mib);
  const auto shared_memory = std::make_shared<SharedMemTransportDescriptor>();
  shared_memory->segment_size(options.shared_memory_mib << 20U);
  transports.push_back(shared_memory);
}

std::uint32_t granted_socket_buffer_bytes(std::uint32_t wanted_bytes) {
  const int socket_fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  if (socket_fd < 0) {
    throw DdsError(std::string("cannot make a UDP socket: ") + std::strerror(errno));
  }
  const int wanted = static_cast<int>(wanted_bytes);
  int granted = 0;
  socklen_t length = sizeof granted;
  ::setsockopt(socket_fd, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);
  ::getsockopt(socket_fd, SOL_SOCKET, SO_RCVBUF, &granted, &length);
  ::close(socket_fd);
  // Linux counts its own bookkeeping and reports twice what it gave.
  return static_cast<std::uint32_t>(granted) / 2;
}

void set_tcp_user_timeout(std::uint16_t listening_port, std::chrono::milliseconds timeout) {
  // Fast DDS does not give its sockets out. An accepted connection inherits what is set here.
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", none)) {
    const std::string name = entry.path().filename();
    int fd = -1;
    std::from_chars(name.data(), name.data() + name.size(), fd);
    if (listening_port_of(fd) != listening_port) continue;
    const auto timeout_ms = static_cast<unsigned int>(timeout.count());
    ::setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout_ms, sizeof timeout_ms);
  }
}

bool has_shared_memory(const eprosima::fastdds::dds::DomainParticipantQos& qos) {
  return std::ranges::any_of(qos.transport().user_transports, is_shared_memory);
}

void leave_out_shared_memory(eprosima::fastdds::dds::DomainParticipantQos& qos) {
  std::erase_if(qos.transport().user_transports, is_shared_memory);
}

}  // namespace stillmap::dds
