#include "idl/dds/interfaces.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <memory>

namespace stillmap::dds {

std::vector<std::string> own_addresses() {
  ifaddrs* list = nullptr;
  std::vector<std::string> addresses;
  if (::getifaddrs(&list) != 0) return addresses;
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owned(list, ::freeifaddrs);
  for (const ifaddrs* one = list; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    if ((one->ifa_flags & IFF_UP) == 0) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
    ::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
    addresses.emplace_back(text.data());
  }
  return addresses;
}

std::string unknown_interfaces(std::span<const std::string> interfaces,
                               std::span<const std::string> own) {
  const auto joined = [](const auto& addresses, const char* separator) {
    std::string text;
    for (const std::string& address : addresses) {
      text.append(text.empty() ? "" : separator).append(address);
    }
    return text;
  };
  std::vector<std::string> unknown;
  std::ranges::copy_if(interfaces, std::back_inserter(unknown), [&](const std::string& address) {
    return std::ranges::find(own, address) == own.end();
  });
  if (unknown.empty()) return {};
  return "interfaces: " + joined(unknown, " and ") +
         (unknown.size() == 1 ? " is no address" : " are no addresses") +
         " of this machine's interfaces that are up; those have " + joined(own, ", ");
}

}  // namespace stillmap::dds
