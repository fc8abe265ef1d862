#include "idl/dds/transports.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "idl/dds/dds_error.hpp"

namespace stillmap {

using namespace eprosima::fastdds::rtps;

std::vector<std::shared_ptr<TransportDescriptorInterface>> make_transports(
    const DdsOptions& options) {
  std::vector<std::shared_ptr<TransportDescriptorInterface>> transports;
  const auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->sendBufferSize = udp->receiveBufferSize = options.socket_buffer_bytes;
  udp->interfaceWhiteList = options.interfaces;
  transports.push_back(udp);
  if (options.shared_memory) {
    // Room for many clouds under way; the default 512 KB loses them.
    constexpr std::uint32_t segment_bytes = 64U << 20U;
    const auto shared_memory = std::make_shared<SharedMemTransportDescriptor>();
    shared_memory->segment_size(segment_bytes);
    transports.push_back(shared_memory);
  }
  return transports;
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

}  // namespace stillmap
