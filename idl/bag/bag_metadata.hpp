#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace stillmap::dds {

/// A topic of a bag.
struct BagTopic {
  /// With its slash: "/points".
  std::string name;
  /// "sensor_msgs/msg/PointCloud2".
  std::string type;
  std::string serialization_format = "cdr";
  /// YAML, as rosbag2 stores it.
  std::string offered_qos_profiles;
  std::uint64_t messages = 0;
  /// In .msg text with the types that it is made of, as MCAP stores it ("ros2msg"); empty where it
  /// is not known.
  std::string definition{};
};

enum class BagCompression { none, of_files, of_messages };

/// The metadata.yaml of a bag (rosbag2, up to version 5 written and up to 9 read).
struct BagMetadata {
  /// "sqlite3" or "mcap".
  std::string storage = "sqlite3";
  /// Names of the files in the bag's folder, in order.
  std::vector<std::string> files;
  BagCompression compression = BagCompression::none;
  std::int64_t start_ns = 0;
  std::int64_t duration_ns = 0;
  std::vector<BagTopic> topics;
};

/// Reads what is needed to open the bag: files and compression. Throws DatasetError for a file that
/// is no metadata of a bag that can be read here, with the way out.
[[nodiscard]] BagMetadata read_bag_metadata(const std::filesystem::path& file);

/// Writes metadata.yaml as ROS 2 Humble does, without compression of its own; replaces the old one
/// in one step. Throws DatasetError.
void write_bag_metadata(const std::filesystem::path& file, const BagMetadata& metadata);

/// How a bag in another format becomes one that can be read here.
[[nodiscard]] std::string conversion_hint();

}  // namespace stillmap::dds
