#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace stillmap::peer {

/// Where the server is.
struct ServerAddress {
  std::uint32_t domain_id = 0;
  /// First part of its topics' and services' names.
  std::string server = "stillmap";
};

/// Publishes the scans of a recording (velodyne/*.bin, labels/*.label) and takes what the server
/// sends meanwhile: odometry, tf, labelled scans.
int play_sequence(const ServerAddress& address, const std::filesystem::path& recording);

/// Joins late and takes all that the server keeps for late joiners.
int join_late(const ServerAddress& address);

/// Watches ros_discovery_info and Cyclone's own discovery until the node's server has gone, and
/// holds one against the other.
int watch_graph(const ServerAddress& address, const std::string& node);

/// Asks every service.
int ask_services(const ServerAddress& address);

/// Asks get_status as so many clients one after the other, each of them new, each once.
int churn_clients(const ServerAddress& address, int clients);

/// The same with the whole octree, asked for half a second after the last client has gone.
int churn_clients_of_large_replies(const ServerAddress& address, int clients);

}  // namespace stillmap::peer
