#pragma once

#include <optional>
#include <string>

#include "core/lidar/point_fields.hpp"
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
                                         const PointFieldNames& names);

}  // namespace stillmap::wire
