#pragma once

#include <optional>
#include <string>
#include <vector>

#include "idl/conversions/point_field.hpp"
#include "idl/msg/wire_types.hpp"

namespace stillmap::wire {

/// Where a value lies in each point of a cloud.
struct PointColumn {
  std::size_t offset = 0;
  FieldType type = FieldType::float32;
  /// As the cloud calls it.
  std::string name;
};

/// Names under which the fields of a cloud may appear; the first that is there is taken. The
/// defaults are those of the drivers of Velodyne, Ouster, Hesai, Livox, RoboSense and Nebula. An
/// Ouster's `intensity` counts photons and its `reflectivity` is calibrated, so that comes first; a
/// Livox's `line` is no ring, as its beams do not keep their elevation.
struct PointFieldCandidates {
  std::vector<std::string> intensity = {"reflectivity", "intensity", "i"};
  std::vector<std::string> ring = {"ring", "channel"};
  std::vector<std::string> time = {"time", "t", "timestamp", "time_stamp", "offset_time"};
  std::vector<std::string> label = {"label"};
};

/// The checked description of a cloud: every point of every column lies within the data.
struct CloudLayout {
  std::size_t width = 0;
  std::size_t height = 0;
  std::size_t point_step = 0;
  /// From one row to the next, padding included.
  std::size_t row_step = 0;
  bool swap_bytes = false;
  PointColumn x, y, z;
  std::optional<PointColumn> intensity, ring, time, label;

  [[nodiscard]] std::size_t points() const { return width * height; }
};

/// Why a cloud cannot be used.
struct CloudFault {
  /// One word for a counter: "size_mismatch".
  std::string counter;
  /// With the field and its value.
  std::string reason;
};

/// Either a layout or a fault.
struct CheckedLayout {
  std::optional<CloudLayout> layout;
  CloudFault fault;
};

/// Checks how a cloud describes itself against its data. Any input is fine.
[[nodiscard]] CheckedLayout check_layout(const sensor_msgs::msg::PointCloud2& cloud,
                                         const PointFieldCandidates& candidates);

}  // namespace stillmap::wire
