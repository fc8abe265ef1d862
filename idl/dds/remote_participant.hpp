#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stillmap::dds {

/// How long a sample outlives its writing, weakest first, as DDS numbers them.
enum class Durability : std::uint8_t { volatile_, transient_local, transient, persistent };

/// "transient local", as diagnostics say it.
[[nodiscard]] const char* name(Durability durability);

/// The policies that decide whether a writer and a reader match.
struct EndpointQos {
  bool reliable = false;
  Durability durability = Durability::volatile_;
  /// Longest time from sample to sample; nothing: no promise.
  std::optional<std::chrono::nanoseconds> deadline;
  /// 0 automatic, 1 manual by participant, 2 manual by topic.
  int liveliness_kind = 0;
  std::optional<std::chrono::nanoseconds> liveliness_lease;
  bool exclusive_ownership = false;
  /// None is the partition without a name.
  std::vector<std::string> partitions;

  auto operator<=>(const EndpointQos&) const = default;
};

/// A reader or writer somewhere in the domain.
struct Endpoint {
  std::string guid;
  /// DDS names ("rt/points", "sensor_msgs::msg::dds_::PointCloud2_").
  std::string topic;
  std::string type;
  bool is_writer = false;
  bool is_keyed = false;
  /// What its owner adds, such as ROS 2's type hash (type_hash.hpp): anything.
  std::string user_data{};
  EndpointQos qos;
};

/// Another process in the domain, as it announces itself.
struct RemoteParticipant {
  /// Prefix of the guids of its endpoints.
  std::string guid;
  std::string name;
  /// The ROS 2 nodes that it holds ("/rviz2"), as far as they are known.
  std::vector<std::string> ros_nodes;
  /// "Fast DDS", "Cyclone DDS", or "vendor 1.7".
  std::string vendor;
  /// Empty when it does not tell.
  std::string host;
  std::string user;
  std::string process;
  /// IPv4 addresses where it receives data.
  std::vector<std::string> addresses;
  bool uses_shared_memory = false;
  bool is_on_this_host = false;
  /// It announces an identity of DDS Security.
  bool is_secured = false;
  /// Its identity or ours was refused, as far as this side was told.
  bool refused = false;
  /// Secured as we are, and neither authenticated nor refused a while after it was discovered: it
  /// refuses us, of which it alone is told, or the handshake stands still.
  bool unauthenticated = false;
  std::vector<Endpoint> endpoints;
};

/// Its ROS 2 nodes, or its own name, or that it has none.
[[nodiscard]] std::string display_name(const RemoteParticipant& peer);

/// "host, process 12, user robot, 192.168.0.5": what is known of where a peer runs.
[[nodiscard]] std::string describe_location(const RemoteParticipant& peer);

/// "stillmap_server (this host, process 12, user robot)".
[[nodiscard]] std::string describe(const RemoteParticipant& peer);

/// "reliable, transient local".
[[nodiscard]] std::string describe(const EndpointQos& qos);

}  // namespace stillmap::dds
