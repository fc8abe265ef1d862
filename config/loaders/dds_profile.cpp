#include "config/loaders/dds_profile.hpp"

#include <arpa/inet.h>

#include <charconv>
#include <cstdlib>
#include <string_view>

#include "config/loaders/named_file.hpp"
#include "config/loaders/yaml_section.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr Range ports{0, 65535};
// As `fastdds discovery` and ROS 2 have it.
constexpr std::uint16_t usual_discovery_port = 11811;

void read_address(YamlSection& file, const std::string& field, const std::string& text,
                  dds::NetworkAddress& address) {
  if (const auto read = network_address_from(text)) {
    address = *read;
  } else {
    file.fault(field, "'" + text + "' is not HOST or HOST:PORT, as 192.168.0.5:7400");
  }
}

void read_peers(YamlSection& file, std::vector<dds::NetworkAddress>& peers) {
  std::vector<std::string> texts;
  file.text_list("peers", texts);
  for (const std::string& text : texts) read_address(file, "peers", text, peers.emplace_back());
}

void read_discovery_server(YamlSection& file, dds::NetworkAddress& server) {
  std::string text;
  file.text("discovery_server", text);
  if (!text.empty()) read_address(file, "discovery_server", text, server);
}

/// What is wrong with addresses of interfaces, in words.
std::vector<std::string> interface_faults(const std::vector<std::string>& interfaces) {
  std::vector<std::string> faults;
  for (const std::string& address : interfaces) {
    in_addr parsed{};
    if (inet_pton(AF_INET, address.c_str(), &parsed) == 1) continue;
    faults.push_back("'" + address + "' is not an IPv4 address such as 192.168.0.5");
  }
  return faults;
}

void read_interfaces(YamlSection& file, std::vector<std::string>& interfaces) {
  file.text_list("interfaces", interfaces);
  for (const std::string& fault : interface_faults(interfaces)) file.fault("interfaces", fault);
}

void check_together(YamlSection& file, const DdsProfile& profile) {
  const dds::DdsOptions& options = profile.options;
  const bool tcp = options.transport == dds::NetworkTransport::tcp;
  if (tcp && profile.server_port == 0) {
    file.fault("server_port", "is missing; over TCP clients connect to it");
  }
  if (tcp && !options.discovery_server.host.empty()) {
    file.fault("discovery_server", "works over UDP only; over TCP clients name the server as peer");
  }
  if (options.large_message_bytes_per_s > 0 &&
      options.large_message_bytes_per_s / 20 < options.max_datagram_bytes) {
    file.fault("large_message_bytes_per_s",
               "must let 20 datagrams of max_datagram_bytes pass a second");
  }
}

void read_profile(YamlSection file, DdsProfile& profile) {
  dds::DdsOptions& options = profile.options;
  file.choice<dds::NetworkTransport>(
      "transport", options.transport,
      {{"udp", dds::NetworkTransport::udp}, {"tcp", dds::NetworkTransport::tcp}});
  file.integer("server_port", profile.server_port, ports);
  file.boolean("shared_memory", options.shared_memory);
  file.boolean("client_shared_memory", profile.client_shared_memory);
  file.integer("shared_memory_mib", options.shared_memory_mib, {1, 1024});
  file.boolean("multicast", options.multicast);
  read_interfaces(file, options.interfaces);
  read_peers(file, options.peers);
  read_discovery_server(file, options.discovery_server);
  file.integer("socket_buffer_bytes", options.socket_buffer_bytes, {65536, 1U << 30U});
  file.integer("max_datagram_bytes", options.max_datagram_bytes, {1000, 65500});
  file.integer("heartbeat_ms", options.heartbeat_ms, {1, 10'000});
  file.integer("repair_delay_ms", options.repair_delay_ms, {0, 1000});
  file.integer("lease_s", options.lease_s, {3, 3600});
  file.integer("large_message_bytes_per_s", options.large_message_bytes_per_s, {0, 2e9});
  check_together(file, profile);
}

NamedFileSearchPaths profile_search_paths() {
  return {.kind = "DDS profile",
          .variable = "STILLMAP_DDS_PROFILES",
          .share = "dds",
          .sources = STILLMAP_DDS_PROFILE_SOURCES};
}

std::vector<dds::NetworkAddress> addresses(const std::vector<std::string>& texts, const char* what,
                                           std::vector<std::string>& faults) {
  std::vector<dds::NetworkAddress> addresses;
  for (const std::string& text : texts) {
    if (const auto address = network_address_from(text)) {
      addresses.push_back(*address);
    } else {
      faults.push_back(std::string(what).append(" '") + text + "' is not HOST or HOST:PORT");
    }
  }
  return addresses;
}

void apply(const DdsNetworkConfig& network, dds::DdsOptions& options) {
  std::vector<std::string> faults;
  for (const std::string& fault : interface_faults(network.interfaces)) {
    faults.push_back("interfaces: " + fault);
  }
  if (network.shared_memory) options.shared_memory = *network.shared_memory;
  if (!network.interfaces.empty()) options.interfaces = network.interfaces;
  if (network.socket_buffer_bytes > 0) options.socket_buffer_bytes = network.socket_buffer_bytes;
  if (!network.peers.empty()) options.peers = addresses(network.peers, "peer", faults);
  if (!network.discovery_server.empty()) {
    const auto servers = addresses({network.discovery_server}, "discovery server", faults);
    if (!servers.empty()) options.discovery_server = servers.front();
    if (options.transport == dds::NetworkTransport::tcp) {
      faults.push_back("DDS profile '" + network.profile +
                       "' goes over TCP, where no discovery server works: give the server as peer");
    }
  }
  if (!faults.empty()) throw ConfigError(faults);
}

}  // namespace

std::optional<dds::NetworkAddress> network_address_from(const std::string& text) {
  const auto colon = text.rfind(':');
  dds::NetworkAddress address{.host = text.substr(0, colon), .port = 0};
  const bool is_host =
      !address.host.empty() && address.host.find_first_of(": \t/") == std::string::npos;
  if (!is_host) return std::nullopt;
  if (colon == std::string::npos) return address;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + colon + 1, end, address.port);
  if (error != std::errc{} || stop != end || address.port == 0) return std::nullopt;
  return address;
}

std::string usual_dds_profile() {
  const auto is_set = [](const char* variable, std::string_view value) {
    const char* const found = std::getenv(variable);
    return found != nullptr && found == value;
  };
  // Humble's nodes then use the loopback interface alone; those from Iron on send no multicast, and
  // look for processes on this machine only.
  if (is_set("ROS_LOCALHOST_ONLY", "1")) return "host";
  return is_set("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST") ? "no_multicast" : "lan";
}

DdsProfile read_dds_profile(const fs::path& file) {
  YamlFile yaml = open_yaml(file);
  DdsProfile profile;
  read_profile(YamlSection(yaml), profile);
  yaml.require_no_faults();
  return profile;
}

DdsProfile load_dds_profile(const std::string& name_or_file) {
  return read_dds_profile(find_named_file(profile_search_paths(), name_or_file));
}

dds::DdsOptions dds_options(const DdsNetworkConfig& network, DdsRole role) {
  const DdsProfile profile = load_dds_profile(network.profile);
  dds::DdsOptions options = profile.options;
  if (role == DdsRole::client && !profile.client_shared_memory) options.shared_memory = false;
  apply(network, options);
  if (role == DdsRole::server) options.listening_port = profile.server_port;
  for (dds::NetworkAddress& peer : options.peers) {
    if (peer.port == 0) peer.port = profile.server_port;
  }
  if (options.discovery_server.port == 0) options.discovery_server.port = usual_discovery_port;
  return options;
}

}  // namespace stillmap
