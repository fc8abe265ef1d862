#include <liblzf/lzf.h>

#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/cloud_content.hpp"

namespace stillmap {
namespace {

/// LZF cannot pack tighter.
constexpr std::uint64_t max_compression = 300;

using PcdHeader = std::map<std::string, Words>;

PcdHeader pcd_header(const std::filesystem::path& file, std::istream& in) {
  PcdHeader header;
  std::string line;
  for (std::size_t lines = 0; lines < max_header_lines && std::getline(in, line); ++lines) {
    Words words = words_of(line);
    if (words.empty() || words.front().starts_with('#')) continue;
    const std::string key = words.front();
    words.erase(words.begin());
    header[key] = words;
    if (key == "DATA") return header;
  }
  throw DatasetError(file, "has no PCD header that ends with DATA; the file is of another kind");
}

const Words& entry(const std::filesystem::path& file, const PcdHeader& header,
                   const std::string& key) {
  const auto found = header.find(key);
  if (found == header.end() || found->second.empty()) {
    throw DatasetError(file, "the PCD header has no " + key + "; the file is damaged");
  }
  return found->second;
}

std::uint64_t count_of(const std::filesystem::path& file, const PcdHeader& header,
                       const std::string& key) {
  return header_count(file, key, entry(file, header, key).front());
}

bool known_type(const CloudField& field) {
  const std::uint64_t size = field.bytes;
  if (field.kind == 'F') return size == 4 || size == 8;
  return (field.kind == 'I' || field.kind == 'U') && (size == 1 || size == 2 || size == 4);
}

std::vector<CloudField> pcd_fields(const std::filesystem::path& file, const PcdHeader& header) {
  const Words& names = entry(file, header, "FIELDS");
  const Words& sizes = entry(file, header, "SIZE");
  const Words& types = entry(file, header, "TYPE");
  const Words counts = header.contains("COUNT") ? header.at("COUNT") : Words(names.size(), "1");
  if (sizes.size() != names.size() || types.size() != names.size() ||
      counts.size() != names.size()) {
    throw DatasetError(file, "FIELDS, SIZE, TYPE and COUNT of the PCD header differ in length");
  }
  std::vector<CloudField> fields;
  for (std::size_t i = 0; i < names.size(); ++i) {
    fields.push_back({names[i], types[i].size() == 1 ? types[i][0] : '?',
                      header_count(file, "SIZE", sizes[i]),
                      header_count(file, "COUNT", counts[i])});
    if (!known_type(fields.back()) || fields.back().count == 0) {
      throw DatasetError(file, "field " + names[i].substr(0, 40) + " has TYPE " +
                                   types[i].substr(0, 40) + ", SIZE " + sizes[i] + ", COUNT " +
                                   counts[i] + ", which cannot be read; convert the file");
    }
  }
  return fields;
}

/// Unpacks the columns of a compressed body: all values of the first field, then all of the next.
std::string unpacked_columns(const std::filesystem::path& file, const CloudContent& content) {
  std::array<std::uint32_t, 2> sizes{};
  check_room(file, content, sizeof sizes);
  std::memcpy(sizes.data(), content.body.data(), sizeof sizes);
  const auto [packed_bytes, unpacked_bytes] = sizes;
  check_room(file, content, sizeof sizes + packed_bytes);
  const std::uint64_t announced = content.points() * content.point_bytes();
  if (unpacked_bytes != announced || unpacked_bytes > max_compression * (packed_bytes + 1ULL)) {
    throw DatasetError(file, "the compressed part unpacks to " + std::to_string(unpacked_bytes) +
                                 " bytes and the header announces " + std::to_string(announced) +
                                 "; the file is damaged");
  }
  std::string columns(unpacked_bytes, '\0');
  if (lzf_decompress(content.body.data() + sizeof sizes, packed_bytes, columns.data(),
                     unpacked_bytes) != unpacked_bytes) {
    throw DatasetError(file, "the compressed part cannot be unpacked; the file is damaged");
  }
  return columns;
}

/// Puts the values of each point behind one another.
std::string points_from_columns(const std::string& columns, const CloudContent& content) {
  const std::uint64_t point_bytes = content.point_bytes();
  std::string points(columns.size(), '\0');
  std::uint64_t offset = 0;
  const char* from = columns.data();
  for (const CloudField& field : content.fields) {
    const std::uint64_t bytes = field.bytes * field.count;
    for (std::uint64_t i = 0; i < content.points(); ++i, from += bytes) {
      std::memcpy(points.data() + i * point_bytes + offset, from, bytes);
    }
    offset += bytes;
  }
  return points;
}

void decode_body(const std::filesystem::path& file, CloudContent& content) {
  if (content.encoding == "ascii") {
    parse_ascii_body(file, content);
  } else if (content.encoding == "binary") {
    check_room(file, content, content.points() * content.point_bytes());
  } else if (content.encoding == "binary_compressed") {
    check_room(file, content, 0);
    if (content.points() > 0) {
      content.body = points_from_columns(unpacked_columns(file, content), content);
    }
  } else {
    throw DatasetError(file, "DATA \"" + content.encoding.substr(0, 40) +
                                 "\" is none of ascii, binary, binary_compressed");
  }
}

}  // namespace

CloudContent read_pcd_content(const std::filesystem::path& file) {
  static_cast<void>(scan_file_size(file));
  std::ifstream in(file, std::ios::binary);
  const PcdHeader header = pcd_header(file, in);
  CloudContent content;
  content.fields = pcd_fields(file, header);
  content.width = count_of(file, header, "WIDTH");
  if (header.contains("HEIGHT")) content.height = count_of(file, header, "HEIGHT");
  if (header.contains("POINTS") && count_of(file, header, "POINTS") != content.points()) {
    throw DatasetError(file, "WIDTH " + std::to_string(content.width) + " times HEIGHT " +
                                 std::to_string(content.height) + " is not POINTS " +
                                 header.at("POINTS").front() + "; the header is damaged");
  }
  content.encoding = entry(file, header, "DATA").front();
  content.body.assign(std::istreambuf_iterator<char>(in), {});
  decode_body(file, content);
  return content;
}

}  // namespace stillmap
