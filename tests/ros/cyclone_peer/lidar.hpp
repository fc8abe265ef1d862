#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/ros/cyclone_peer/endpoints.hpp"

namespace stillmap::peer {

/// Publishes the scans of a recording on rt/points, as a lidar driver of ROS 2 does: x y z
/// intensity (float32) and label (uint32), a tenth of a second apart by their stamps, in frame
/// velodyne.
class Lidar {
 public:
  /// `recording` has velodyne/*.bin and labels/*.label.
  Lidar(const Participant& participant, const std::filesystem::path& recording);

  [[nodiscard]] std::size_t scans() const { return names_.size(); }
  [[nodiscard]] bool is_matched() const { return writer_.is_matched(); }

  /// Waits while the reader has no room. Throws when the scan cannot be read.
  void publish(std::size_t scan);

 private:
  using Cloud = sensor_msgs_msg_dds__PointCloud2_;
  using Field = sensor_msgs_msg_dds__PointField_;

  std::filesystem::path recording_;
  std::vector<std::filesystem::path> names_;
  std::array<std::string, 5> field_names_ = {"x", "y", "z", "intensity", "label"};
  std::array<Field, 5> fields_{};
  Writer<Cloud> writer_;
};

}  // namespace stillmap::peer
