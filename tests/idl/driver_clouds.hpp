#pragma once

#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "idl/conversions/point_field.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// How a driver writes the time of a point.
enum class DriverTime {
  none,
  seconds_from_first_point,
  /// The stamp is that of the last packet.
  seconds_before_stamp,
  nanoseconds_from_first_point,
  seconds_since_1970,
  nanoseconds_since_1970,
};

struct DriverField {
  std::string name;
  std::uint32_t offset;
  FieldType type;
};

/// The PointCloud2 that a driver publishes, as its source code declares it.
struct DriverLayout {
  std::string name;
  std::vector<DriverField> fields;
  std::uint32_t point_step;
  DriverTime time;
  /// Which field is the calibrated intensity, and its largest number.
  std::string intensity;
  float full_scale;
  /// Name of the field with the beam; empty when there is none.
  std::string ring;
  /// Rows and columns, with NaN (or zero) where nothing was measured; else one row.
  bool organised;
  bool invalid_is_nan;
  /// Bytes behind every row.
  std::uint32_t row_padding;
};

/// Layouts of the drivers that are in use.
[[nodiscard]] std::vector<DriverLayout> driver_layouts();

/// What a 16-beam sensor saw in 64 columns: some points (every 11th) were not measured. Intensity
/// 0..1, time from the first point.
[[nodiscard]] Scan seen_by_driver();
[[nodiscard]] bool was_measured(std::size_t i);

/// The bytes in which the driver sends it.
[[nodiscard]] sensor_msgs::msg::PointCloud2 as_driver_sends(const DriverLayout& layout,
                                                            const Scan& seen);

}  // namespace stillmap::wire
