#include "tests/clients/http_get.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <stdexcept>

namespace stillmap::test {
namespace {

sockaddr_in loopback_port(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

}  // namespace

HeldPort::HeldPort() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address = loopback_port(0);
  socklen_t size = sizeof address;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  if (bind(socket_, generic, size) != 0 || listen(socket_, 1) != 0 ||
      getsockname(socket_, generic, &size) != 0) {
    throw std::runtime_error("no free port on 127.0.0.1");
  }
  number_ = ntohs(address.sin_port);
}

HeldPort::~HeldPort() { close(socket_); }

std::string http_get(int port, const std::string& path) {
  const int connection = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = loopback_port(port);
  std::string answer;
  if (connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    const std::string request = "GET " + path + " HTTP/1.0\r\nHost: localhost\r\n\r\n";
    ssize_t got = write(connection, request.data(), request.size());
    std::array<char, 4096> part{};
    while (got > 0) {
      got = read(connection, part.data(), part.size());
      if (got > 0) answer.append(part.data(), static_cast<std::size_t>(got));
    }
  }
  close(connection);
  const std::size_t body = answer.find("\r\n\r\n");
  const bool is_ok = answer.starts_with("HTTP/1.") && answer.substr(8, 4) == " 200";
  return is_ok && body != std::string::npos ? answer.substr(body + 4) : "";
}

}  // namespace stillmap::test
