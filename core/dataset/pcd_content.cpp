#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/cloud_content.hpp"

namespace stillmap {
namespace {

constexpr std::size_t max_header_lines = 1000;
/// LZF cannot pack tighter.
constexpr std::uint64_t max_compression = 300;

using Words = std::vector<std::string>;
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

void check_compressed(const std::filesystem::path& file, const CloudContent& content) {
  std::array<std::uint32_t, 2> sizes{};
  check_room(file, content, sizeof sizes);
  std::memcpy(sizes.data(), content.body.data(), sizeof sizes);
  check_room(file, content, sizeof sizes + sizes[0]);
  const std::uint64_t unpacked = content.points() * content.point_bytes();
  if (sizes[1] != unpacked || sizes[1] > max_compression * (sizes[0] + 1ULL)) {
    throw DatasetError(file, "the compressed part unpacks to " + std::to_string(sizes[1]) +
                                 " bytes and the header announces " + std::to_string(unpacked) +
                                 "; the file is damaged");
  }
}

void check_body(const std::filesystem::path& file, const CloudContent& content) {
  const std::uint64_t points = content.points();
  if (content.encoding == "ascii") {
    // A digit and a blank or line's end for each field, but for the last.
    check_room(file, content, points == 0 ? 0 : 2 * points * content.fields.size() - 1);
  } else if (content.encoding == "binary") {
    check_room(file, content, points * content.point_bytes());
  } else if (content.encoding == "binary_compressed") {
    if (points > 0) check_compressed(file, content);
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
  check_body(file, content);
  return content;
}

}  // namespace stillmap
