#include "core/dataset/cloud_content.hpp"

#include <sstream>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {
namespace {

constexpr std::uint64_t max_points = std::uint64_t{1} << 26;
constexpr std::uint64_t max_point_bytes = 4096;

}  // namespace

std::uint64_t CloudContent::point_bytes() const {
  std::uint64_t bytes = 0;
  for (const CloudField& field : fields) bytes += field.bytes * field.count;
  return bytes;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

std::uint64_t header_count(const std::filesystem::path& file, const std::string& field,
                           const std::string& word) {
  constexpr std::size_t max_digits = 9;
  if (word.empty() || word.size() > max_digits ||
      word.find_first_not_of("0123456789") != std::string::npos) {
    throw DatasetError(file, field + " in the header is \"" + word.substr(0, 40) +
                                 "\", not a count that a scan can have");
  }
  return std::stoull(word);
}

void check_room(const std::filesystem::path& file, const CloudContent& content,
                std::uint64_t needed_bytes) {
  const std::uint64_t point_bytes = content.point_bytes();
  if (content.points() > max_points || point_bytes == 0 || point_bytes > max_point_bytes) {
    throw DatasetError(file, "the header announces " + std::to_string(content.points()) +
                                 " points of " + std::to_string(point_bytes) +
                                 " bytes, which is not a scan; the header is damaged");
  }
  if (needed_bytes > content.body.size()) {
    throw DatasetError(file, "is truncated: the header announces at least " +
                                 std::to_string(needed_bytes) + " bytes of points and " +
                                 std::to_string(content.body.size()) +
                                 " follow; copy the file again or remove it");
  }
}

}  // namespace stillmap
