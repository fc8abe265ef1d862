#include "clients/doctor/domain_scan.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

namespace stillmap::cli {
namespace {

// RTPS 9.6.1.1: discovery by multicast in a domain goes to 239.255.0.1, port 7400 + 250 * id.
constexpr std::uint32_t first_port = 7400;
constexpr std::uint32_t ports_per_domain = 250;
constexpr std::uint32_t domains = 233;

std::vector<in_addr> own_addresses() {
  ifaddrs* list = nullptr;
  std::vector<in_addr> addresses;
  if (::getifaddrs(&list) != 0) return addresses;
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owned(list, ::freeifaddrs);
  for (const ifaddrs* one = list; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    if ((one->ifa_flags & IFF_UP) == 0) continue;
    addresses.push_back(reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr);
  }
  return addresses;
}

/// A socket that hears the announcements of one domain.
class MulticastListener {
 public:
  MulticastListener(std::uint32_t domain, std::span<const in_addr> interfaces)
      : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    const int on = 1;
    ::setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(first_port + ports_per_domain * domain));
    // Bound to the group, so that unicast packets still reach the processes they are for.
    address.sin_addr.s_addr = inet_addr("239.255.0.1");
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return;
    for (const in_addr& interface : interfaces) {
      const ip_mreq membership{.imr_multiaddr = address.sin_addr, .imr_interface = interface};
      ::setsockopt(socket_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership);
    }
  }
  ~MulticastListener() {
    if (socket_ >= 0) ::close(socket_);
  }
  MulticastListener(MulticastListener&& other) noexcept
      : socket_(std::exchange(other.socket_, -1)) {}
  MulticastListener& operator=(MulticastListener&&) = delete;

  [[nodiscard]] int descriptor() const { return socket_; }

  /// Reads the waiting RTPS packets and adds their senders.
  void take(std::set<std::string>& senders) const {
    std::array<char, 64> head{};
    sockaddr_in from{};
    socklen_t length = sizeof from;
    ssize_t bytes = 0;
    while ((bytes = ::recvfrom(socket_, head.data(), head.size(), 0,
                               reinterpret_cast<sockaddr*>(&from), &length)) >= 0) {
      std::array<char, INET_ADDRSTRLEN> text{};
      if (bytes < 4 || std::memcmp(head.data(), "RTPS", 4) != 0) continue;
      senders.insert(::inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size()));
    }
  }

 private:
  int socket_;
};

}  // namespace

DomainSenders scan_domains(std::chrono::milliseconds duration) {
  const std::vector<in_addr> interfaces = own_addresses();
  std::vector<MulticastListener> listeners;
  std::vector<pollfd> waiting;
  for (std::uint32_t domain = 0; domain < domains; ++domain) {
    const MulticastListener& listener = listeners.emplace_back(domain, interfaces);
    waiting.push_back({.fd = listener.descriptor(), .events = POLLIN, .revents = 0});
  }
  DomainSenders found;
  const auto end = std::chrono::steady_clock::now() + duration;
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) return found;
    ::poll(waiting.data(), waiting.size(), static_cast<int>(left.count()));
    for (std::uint32_t domain = 0; domain < domains; ++domain) {
      if ((waiting[domain].revents & POLLIN) != 0) listeners[domain].take(found[domain]);
    }
    std::erase_if(found, [](const auto& one) { return one.second.empty(); });
  }
}

std::set<std::uint32_t> domains_with_ports(std::span<const std::uint16_t> udp_ports) {
  std::set<std::uint32_t> used;
  for (const std::uint16_t port : udp_ports) {
    if (port < first_port || (port - first_port) % ports_per_domain != 0) continue;
    const std::uint32_t domain = (port - first_port) / ports_per_domain;
    if (domain < domains) used.insert(domain);
  }
  return used;
}

}  // namespace stillmap::cli
