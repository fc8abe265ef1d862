#pragma once

#include <cstring>
#include <string>
#include <vector>

#include "idl/conversions/point_cloud2_builder.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// A cloud of three points with float32 x y z: (1, 2, 3), (4, 5, 6), (7, 8, 9).
inline sensor_msgs::msg::PointCloud2 three_points() {
  PointCloud2Builder columns(1'500'000'000, "lidar");
  const auto x = columns.add_field("x", FieldType::float32);
  const auto y = columns.add_field("y", FieldType::float32);
  const auto z = columns.add_field("z", FieldType::float32);
  columns.resize(3);
  columns.fill(x, [](std::size_t i) { return 1.0F + 3.0F * static_cast<float>(i); });
  columns.fill(y, [](std::size_t i) { return 2.0F + 3.0F * static_cast<float>(i); });
  columns.fill(z, [](std::size_t i) { return 3.0F + 3.0F * static_cast<float>(i); });
  return columns.take();
}

/// The same with one more field of type T that holds these values.
template <typename T>
sensor_msgs::msg::PointCloud2 three_points_with(const std::string& field, FieldType type,
                                                const std::vector<T>& values) {
  PointCloud2Builder columns(1'500'000'000, "lidar");
  const auto x = columns.add_field("x", FieldType::float32);
  columns.add_field("y", FieldType::float32);
  columns.add_field("z", FieldType::float32);
  const auto extra = columns.add_field(field, type);
  columns.resize(values.size());
  columns.fill(x, [](std::size_t i) { return static_cast<float>(i); });
  columns.fill(extra, [&](std::size_t i) { return values[i]; });
  return columns.take();
}

}  // namespace stillmap::wire
