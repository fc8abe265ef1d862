#include "config/loaders/listening_address.hpp"

#include <arpa/inet.h>

#include <charconv>

namespace stillmap {
namespace {

bool is_host(std::string host) {
  in6_addr parsed{};
  if (!host.starts_with('[')) return inet_pton(AF_INET, host.c_str(), &parsed) == 1;
  if (!host.ends_with(']')) return false;
  host = host.substr(1, host.size() - 2);
  return inet_pton(AF_INET6, host.c_str(), &parsed) == 1;
}

bool is_port(const std::string& text) {
  int port = -1;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, port);
  return error == std::errc{} && stop == end && port >= 0 && port <= 65535;
}

}  // namespace

std::string listening_address_fault(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  const bool is_address = colon != std::string::npos && is_host(address.substr(0, colon)) &&
                          is_port(address.substr(colon + 1));
  if (is_address) return {};
  std::string fault = "'" + address + "' is not an IP address with a port";
  return fault.append(", such as 127.0.0.1:9464, 0.0.0.0:9464 or [::1]:9464");
}

}  // namespace stillmap
