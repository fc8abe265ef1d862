#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "sensor_msgs.h"

namespace stillmap::wire {

/// The type of a field, in sensor_msgs/PointField's numbers.
enum class FieldType : std::uint8_t {
  int8 = sensor_msgs::msg::PointField_Constants::INT8,
  uint8 = sensor_msgs::msg::PointField_Constants::UINT8,
  int16 = sensor_msgs::msg::PointField_Constants::INT16,
  uint16 = sensor_msgs::msg::PointField_Constants::UINT16,
  int32 = sensor_msgs::msg::PointField_Constants::INT32,
  uint32 = sensor_msgs::msg::PointField_Constants::UINT32,
  float32 = sensor_msgs::msg::PointField_Constants::FLOAT32,
  float64 = sensor_msgs::msg::PointField_Constants::FLOAT64,
};

/// Nothing for a number that ROS 2 does not define.
[[nodiscard]] constexpr std::optional<FieldType> field_type(std::uint8_t datatype) {
  constexpr auto first = static_cast<std::uint8_t>(FieldType::int8);
  constexpr auto last = static_cast<std::uint8_t>(FieldType::float64);
  if (datatype < first || datatype > last) return std::nullopt;
  return static_cast<FieldType>(datatype);
}

/// "uint16".
[[nodiscard]] constexpr const char* name_of(FieldType type) {
  constexpr std::array names = {"int8",  "uint8",  "int16",   "uint16",
                                "int32", "uint32", "float32", "float64"};
  return names.at(static_cast<std::size_t>(type) - 1);
}

[[nodiscard]] constexpr bool is_integer(FieldType type) { return type < FieldType::float32; }

/// A value at any address, its bytes reversed if they are the other way round than this machine's.
template <typename T>
[[nodiscard]] T load(const std::uint8_t* address, bool swap_bytes) {
  std::uint8_t bytes[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    bytes[i] = address[swap_bytes ? sizeof(T) - 1 - i : i];
  }
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

/// Calls `visit` with a value of the C++ type behind `type`.
template <typename Visitor>
constexpr void with_type(FieldType type, Visitor visit) {
  switch (type) {
    case FieldType::int8:
      return visit(std::int8_t{});
    case FieldType::uint8:
      return visit(std::uint8_t{});
    case FieldType::int16:
      return visit(std::int16_t{});
    case FieldType::uint16:
      return visit(std::uint16_t{});
    case FieldType::int32:
      return visit(std::int32_t{});
    case FieldType::uint32:
      return visit(std::uint32_t{});
    case FieldType::float32:
      return visit(float{});
    case FieldType::float64:
      return visit(double{});
  }
}

[[nodiscard]] constexpr std::size_t size_of(FieldType type) {
  std::size_t bytes = 0;
  with_type(type, [&](auto value) { bytes = sizeof value; });
  return bytes;
}

}  // namespace stillmap::wire
