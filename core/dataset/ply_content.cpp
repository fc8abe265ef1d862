#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <string_view>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/cloud_content.hpp"

namespace stillmap {
namespace {

struct PlyType {
  std::string_view name;
  char kind;
  std::uint64_t bytes;
};

constexpr std::array<PlyType, 16> ply_types{{{"char", 'I', 1},
                                             {"int8", 'I', 1},
                                             {"uchar", 'U', 1},
                                             {"uint8", 'U', 1},
                                             {"short", 'I', 2},
                                             {"int16", 'I', 2},
                                             {"ushort", 'U', 2},
                                             {"uint16", 'U', 2},
                                             {"int", 'I', 4},
                                             {"int32", 'I', 4},
                                             {"uint", 'U', 4},
                                             {"uint32", 'U', 4},
                                             {"float", 'F', 4},
                                             {"float32", 'F', 4},
                                             {"double", 'F', 8},
                                             {"float64", 'F', 8}}};

CloudField ply_field(const std::filesystem::path& file, const Words& words) {
  const auto type = std::ranges::find(ply_types, words[1], &PlyType::name);
  if (type != ply_types.end()) return {words[2], type->kind, type->bytes, 1};
  throw DatasetError(file, "property type \"" + words[1].substr(0, 40) +
                               "\" cannot be read; write points with plain numbers only");
}

/// Takes one line of the header; `elements` counts the elements so far.
void take_line(const std::filesystem::path& file, const Words& words, CloudContent& content,
               int& elements) {
  if (words[0] == "format" && words.size() >= 2) content.encoding = words[1];
  if (words[0] == "element" && words.size() >= 3 && ++elements == 1) {
    if (words[1] != "vertex") {
      throw DatasetError(file, "the first element is not \"vertex\"; export the points first");
    }
    content.width = header_count(file, "element vertex", words[2]);
  }
  if (words[0] == "property" && words.size() >= 3 && elements == 1) {
    content.fields.push_back(ply_field(file, words));
  }
}

void swap_bytes(CloudContent& content) {
  char* bytes = content.body.data();
  for (std::uint64_t i = 0; i < content.points(); ++i) {
    for (const CloudField& field : content.fields) {
      std::reverse(bytes, bytes + field.bytes);
      bytes += field.bytes;
    }
  }
}

}  // namespace

CloudContent read_ply_header(const std::filesystem::path& file, std::istream& in) {
  std::string line;
  if (!std::getline(in, line) || words_of(line) != Words{"ply"}) {
    throw DatasetError(file, "does not begin with \"ply\"; the file is of another kind");
  }
  CloudContent content;
  int elements = 0;
  for (std::size_t lines = 0; lines < max_header_lines && std::getline(in, line); ++lines) {
    const Words words = words_of(line);
    if (words.empty()) continue;
    if (words[0] == "end_header") return content;
    take_line(file, words, content, elements);
  }
  throw DatasetError(file, "has no \"end_header\"; the file is damaged");
}

CloudContent read_ply_content(const std::filesystem::path& file) {
  static_cast<void>(scan_file_size(file));
  std::ifstream in(file, std::ios::binary);
  CloudContent content = read_ply_header(file, in);
  content.body.assign(std::istreambuf_iterator<char>(in), {});
  if (content.encoding == "ascii") {
    parse_ascii_body(file, content);
  } else if (content.encoding == "binary_little_endian" ||
             content.encoding == "binary_big_endian") {
    check_room(file, content, content.points() * content.point_bytes());
    if (content.encoding == "binary_big_endian") swap_bytes(content);
  } else {
    throw DatasetError(file, "format \"" + content.encoding.substr(0, 40) + "\" is not PLY's");
  }
  return content;
}

}  // namespace stillmap
