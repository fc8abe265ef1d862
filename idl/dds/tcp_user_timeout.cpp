#include "idl/dds/tcp_user_timeout.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <charconv>
#include <filesystem>
#include <optional>
#include <string>

namespace stillmap::dds {
namespace {

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

void set_tcp_user_timeout(std::uint16_t listening_port, std::chrono::milliseconds timeout) {
  // Fast DDS shows its sockets to nobody. An accepted connection inherits what is set here.
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

}  // namespace stillmap::dds
