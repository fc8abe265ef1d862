#include "idl/conversions/point_field.hpp"

#include <array>

namespace stillmap::wire {

std::optional<FieldType> field_type(std::uint8_t datatype) {
  constexpr auto first = static_cast<std::uint8_t>(FieldType::int8);
  constexpr auto last = static_cast<std::uint8_t>(FieldType::float64);
  if (datatype < first || datatype > last) return std::nullopt;
  return static_cast<FieldType>(datatype);
}

std::size_t size_of(FieldType type) {
  std::size_t bytes = 0;
  with_type(type, [&](auto value) { bytes = sizeof value; });
  return bytes;
}

const char* name_of(FieldType type) {
  constexpr std::array names = {"int8",  "uint8",  "int16",   "uint16",
                                "int32", "uint32", "float32", "float64"};
  return names.at(static_cast<std::size_t>(type) - 1);
}

}  // namespace stillmap::wire
