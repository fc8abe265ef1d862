#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/loaders/config_error.hpp"
#include "idl/dds/dds_options.hpp"

namespace stillmap {

/// Settings of DDS for one kind of network, as the files in config/dds describe it.
struct DdsProfile {
  /// What holds for every process. The defaults are those of `lan`.
  dds::DdsOptions options;
  /// Port of stillmap-server: it listens there, and peers without a port are looked for there. 0:
  /// the ports that DDS counts from domain and process.
  std::uint16_t server_port = 0;
  /// Whether clients use shared memory too, or only server and sensors do.
  bool client_shared_memory = false;
};

/// Reads a profile such as config/dds/lan.yaml. Throws ConfigError with every fault.
[[nodiscard]] DdsProfile read_dds_profile(const std::filesystem::path& file);

/// A profile by its name (host, lan, wifi, wan, no_multicast: NAME.yaml in $STILLMAP_DDS_PROFILES,
/// in share/stillmap/dds beside the program's folder, or in the sources), or by its file. Throws
/// ConfigError with every fault, or with the names that there are.
[[nodiscard]] DdsProfile load_dds_profile(const std::string& name_or_file);

/// "HOST" or "HOST:PORT"; nothing when it is neither.
[[nodiscard]] std::optional<dds::NetworkAddress> network_address_from(const std::string& text);

/// The profile where none is chosen: by the variables with which ROS 2 nodes stay on their machine,
/// host (ROS_LOCALHOST_ONLY=1) or no_multicast (ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST), which
/// finds them; else lan.
[[nodiscard]] std::string usual_dds_profile();

/// What one deployment says: a profile, and what differs from it there.
struct DdsNetworkConfig {
  /// As load_dds_profile takes it.
  std::string profile = usual_dds_profile();
  /// What is not given stays as the profile has it.
  std::optional<bool> shared_memory;
  std::vector<std::string> interfaces;
  /// "HOST" or "HOST:PORT".
  std::vector<std::string> peers;
  std::string discovery_server;
  /// 0: not given.
  std::uint32_t socket_buffer_bytes = 0;
};

/// A sensor publishes scans or records them, a client asks for maps and listens to poses.
enum class DdsRole { server, sensor, client };

/// The options that a deployment chooses. Throws ConfigError with every fault.
[[nodiscard]] dds::DdsOptions dds_options(const DdsNetworkConfig& network, DdsRole role);

}  // namespace stillmap
