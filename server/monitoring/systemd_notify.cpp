#include "server/monitoring/systemd_notify.hpp"

#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace stillmap::server {
namespace {

/// False when the state did not arrive.
bool send_to(const std::string& address, const std::string& state) {
  sockaddr_un target{};
  target.sun_family = AF_UNIX;
  if (address.empty() || address.size() >= sizeof target.sun_path) return false;
  std::memcpy(target.sun_path, address.data(), address.size());
  // An abstract address is written with @ and begins with a zero byte.
  if (address.front() == '@') target.sun_path[0] = '\0';
  const int socket_fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_fd < 0) return false;
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size());
  const auto sent = sendto(socket_fd, state.data(), state.size(), MSG_NOSIGNAL,
                           reinterpret_cast<const sockaddr*>(&target), length);
  close(socket_fd);
  return sent == static_cast<ssize_t>(state.size());
}

}  // namespace

void notify_systemd(const std::string& state) {
  const char* const address = std::getenv("NOTIFY_SOCKET");
  if (address == nullptr) return;
  if (!send_to(address, state)) {
    spdlog::warn("systemd does not hear '{}': NOTIFY_SOCKET {} takes nothing", state, address);
  }
}

}  // namespace stillmap::server
