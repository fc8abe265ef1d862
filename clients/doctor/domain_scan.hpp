#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>

namespace stillmap::cli {

/// Domains in which somebody announces itself by multicast, with the IPv4 addresses that it comes
/// from.
using DomainSenders = std::map<std::uint32_t, std::set<std::string>>;

/// Listens to the discovery ports of all domains for a while. Takes part in none of them. DDS
/// participants announce themselves every 1 to 3 s by default.
[[nodiscard]] DomainSenders scan_domains(std::chrono::milliseconds duration);

/// Domains whose discovery port is in use on this machine.
[[nodiscard]] std::set<std::uint32_t> domains_with_ports(std::span<const std::uint16_t> udp_ports);

}  // namespace stillmap::cli
