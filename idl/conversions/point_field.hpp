#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

namespace stillmap::wire {

/// sensor_msgs/PointField's numbers for the types of a field.
enum class FieldType : std::uint8_t {
  int8 = 1,
  uint8 = 2,
  int16 = 3,
  uint16 = 4,
  int32 = 5,
  uint32 = 6,
  float32 = 7,
  float64 = 8,
};

/// Nothing for a number that ROS 2 does not define.
[[nodiscard]] std::optional<FieldType> field_type(std::uint8_t datatype);

[[nodiscard]] std::size_t size_of(FieldType type);

/// "uint16".
[[nodiscard]] const char* name_of(FieldType type);

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
void with_type(FieldType type, Visitor visit) {
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

}  // namespace stillmap::wire
