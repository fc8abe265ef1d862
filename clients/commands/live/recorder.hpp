#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "idl/dds/dds_options.hpp"

namespace stillmap::cli {

struct RecorderOptions {
  dds::DdsOptions dds;
  /// First part of the server's topic names.
  std::string server_name = "stillmap";
  /// The sensor's topic, and that of its odometry.
  std::string points_topic = "points";
  std::string odometry_topic = "odom_prior";
  /// ROS 2 names to record; empty: all that can be.
  std::vector<std::string> topics;
  /// New folder of the bag.
  std::filesystem::path folder;
};

struct RecordedTopic {
  std::string name;
  std::uint64_t messages = 0;
  /// Left out between two that came, as the writers number them. On topics of which only the newest
  /// counts (latched ones), those that were replaced before they came are not lost.
  std::uint64_t lost = 0;
  /// Publishers that are there now.
  int publishers = 0;
};

/// Takes samples from DDS as they are, undecoded, and writes them to a rosbag2. What waits to be
/// taken is bounded by the depth of the readers: who calls too rarely loses samples, and they are
/// counted. One thread uses it.
class Recorder {
 public:
  /// Joins the domain and makes the bag. Throws DdsError, DatasetError for a folder that is there
  /// already, std::invalid_argument for a topic that cannot be recorded.
  explicit Recorder(const RecorderOptions& options);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Writes what has arrived. Throws DatasetError when it cannot.
  void write_received();
  /// Brings it to the disk.
  void commit();
  /// The last commit; leaves a bag in one plain file.
  void finish();

  [[nodiscard]] std::vector<RecordedTopic> topics() const;
  [[nodiscard]] std::uint64_t messages() const;
  [[nodiscard]] std::uint64_t bytes() const;
  [[nodiscard]] std::uint64_t lost() const;

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace stillmap::cli
