#include "core/dataset/cloud_content.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <limits>
#include <sstream>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {
namespace {

constexpr std::uint64_t max_points = std::uint64_t{1} << 26;
/// Calls `use(T{})` with the field's type.
template <class Use>
auto with_type(const CloudField& field, Use use) {
  const bool is_signed = field.kind == 'I';
  if (field.kind == 'F') return field.bytes == 4 ? use(float{}) : use(double{});
  if (field.bytes == 1) return is_signed ? use(std::int8_t{}) : use(std::uint8_t{});
  if (field.bytes == 2) return is_signed ? use(std::int16_t{}) : use(std::uint16_t{});
  return is_signed ? use(std::int32_t{}) : use(std::uint32_t{});
}

template <class T>
T converted(double value) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<T>(value);
  } else {
    const bool fits =
        value >= std::numeric_limits<T>::min() && value <= std::numeric_limits<T>::max();
    return fits ? static_cast<T>(value) : T{};
  }
}

void append_value(const CloudField& field, double value, std::string& to) {
  with_type(field, [&]<class T>(T) {
    const T stored = converted<T>(value);
    to.append(reinterpret_cast<const char*>(&stored), sizeof stored);
  });
}

}  // namespace

double field_value(const CloudField& field, const char* from, bool swap) {
  return with_type(field, [&]<class T>(T value) {
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), from, sizeof(T));
    if (swap) std::ranges::reverse(bytes);
    std::memcpy(&value, bytes.data(), sizeof(T));
    return static_cast<double>(value);
  });
}

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

std::optional<double> number_of(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double number = 0.0;
  const char* const end = word.data() + word.size();
  const auto [stopped, error] = std::from_chars(word.data(), end, number);
  if (error != std::errc{} || stopped != end) return std::nullopt;
  return number;
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

void parse_ascii_body(const std::filesystem::path& file, CloudContent& content) {
  std::uint64_t values = 0;
  for (const CloudField& field : content.fields) values += field.count;
  // Every value takes a digit and a separator, but the last one.
  check_room(file, content, content.points() == 0 ? 0 : 2 * content.points() * values - 1);
  std::istringstream text(std::move(content.body));
  content.body.clear();
  content.body.reserve(content.points() * content.point_bytes());
  std::string word;
  for (std::uint64_t i = 0; i < content.points(); ++i) {
    for (const CloudField& field : content.fields) {
      for (std::uint64_t k = 0; k < field.count; ++k) {
        const auto value = text >> word ? number_of(word) : std::nullopt;
        if (!value) {
          throw DatasetError(file, "point " + std::to_string(i) + " has no number for " +
                                       field.name.substr(0, 40) + "; the file is damaged");
        }
        append_value(field, *value, content.body);
      }
    }
  }
}

}  // namespace stillmap
