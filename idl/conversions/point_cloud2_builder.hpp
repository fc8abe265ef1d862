#pragma once

#include <cstring>
#include <string>
#include <utility>

#include "core/lidar/semantic_class.hpp"
#include "idl/conversions/header.hpp"
#include "idl/conversions/point_field.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// The class's colour as RViz2 and PCL pack it into the field rgb, which they want declared as a
/// float32. Points without a class are grey: black would vanish on RViz2's background.
[[nodiscard]] inline std::uint32_t packed_colour(SemanticClass label) {
  constexpr std::uint32_t grey = 0x909090;
  if (label == SemanticClass::unlabeled) return grey;
  const Rgb rgb = colour(label);
  return (std::uint32_t{rgb.r} << 16U) | (std::uint32_t{rgb.g} << 8U) | rgb.b;
}

/// Builds an unordered cloud: declare the fields, give it its size, fill column by column.
class PointCloud2Builder {
 public:
  PointCloud2Builder(std::int64_t stamp_ns, const std::string& frame) {
    cloud_.header(to_header(stamp_ns, frame));
  }

  /// Appends a field; returns its offset.
  std::uint32_t add_field(const std::string& name, FieldType type) {
    sensor_msgs::msg::PointField field;
    field.name(name);
    field.offset(cloud_.point_step());
    field.datatype(static_cast<std::uint8_t>(type));
    field.count(1);
    cloud_.fields().push_back(field);
    cloud_.point_step(cloud_.point_step() + static_cast<std::uint32_t>(size_of(type)));
    return field.offset();
  }

  /// After the last field, before the first value. Points begin at multiples of 4 bytes: readers
  /// look at their floats in place.
  void resize(std::size_t points) {
    constexpr std::uint32_t alignment = 4;
    cloud_.point_step((cloud_.point_step() + alignment - 1) / alignment * alignment);
    cloud_.height(1);
    cloud_.width(static_cast<std::uint32_t>(points));
    cloud_.row_step(cloud_.width() * cloud_.point_step());
    cloud_.data().resize(cloud_.row_step());
  }

  /// Writes `value(i)` for every point. The value's type must be the field's.
  template <typename Value>
  void fill(std::uint32_t offset, Value value) {
    std::uint8_t* at = cloud_.data().data() + offset;
    for (std::size_t i = 0; i < cloud_.width(); ++i, at += cloud_.point_step()) {
      const auto one = value(i);
      std::memcpy(at, &one, sizeof one);
    }
  }

  /// Of a cloud without points that are not finite.
  void set_dense() { cloud_.is_dense(true); }

  [[nodiscard]] sensor_msgs::msg::PointCloud2 take() { return std::move(cloud_); }

 private:
  sensor_msgs::msg::PointCloud2 cloud_;
};

}  // namespace stillmap::wire
