#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace stillmap {

/// A property of a PLY file's points.
struct PlyField {
  std::string type;
  std::string name;
};

template <class T>
std::string ply_bytes(double number, bool big_endian) {
  const T value = static_cast<T>(number);
  const char* bytes = reinterpret_cast<const char*>(&value);
  std::string text(bytes, bytes + sizeof value);
  if (big_endian) std::ranges::reverse(text);
  return text;
}

inline std::string ply_value(const std::string& type, double number, const std::string& encoding) {
  if (encoding == "ascii") {
    std::ostringstream text;
    text.precision(12);
    text << number << ' ';
    return text.str();
  }
  const bool big = encoding == "binary_big_endian";
  if (type == "uchar") return ply_bytes<std::uint8_t>(number, big);
  if (type == "short") return ply_bytes<std::int16_t>(number, big);
  if (type == "int") return ply_bytes<std::int32_t>(number, big);
  if (type == "float") return ply_bytes<float>(number, big);
  return ply_bytes<double>(number, big);
}

/// A PLY file as editors write them: these fields, a row of numbers a point.
inline std::string ply_text(const std::string& encoding, const std::vector<PlyField>& fields,
                            const std::vector<std::vector<double>>& rows) {
  std::string text = "ply\nformat " + encoding + " 1.0\ncomment Created by an editor\n" +
                     "element vertex " + std::to_string(rows.size()) + "\n";
  for (const PlyField& field : fields) {
    text.append("property ").append(field.type).append(" ").append(field.name).append("\n");
  }
  text += "end_header\n";
  for (const std::vector<double>& row : rows) {
    for (std::size_t i = 0; i < fields.size(); ++i) {
      text += ply_value(fields[i].type, row[i], encoding);
    }
    if (encoding == "ascii") text += "\n";
  }
  return text;
}

}  // namespace stillmap
