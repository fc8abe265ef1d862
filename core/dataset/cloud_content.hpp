#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap {

// The points of PCD and PLY files as they are stored, checked. All functions throw DatasetError.

/// Field of a point: kind F (floating), I or U (integer, signed or unsigned) as PCD names them.
struct CloudField {
  std::string name;
  char kind = 'F';
  /// Of one value; a point has `count` of them.
  std::uint64_t bytes = 4;
  std::uint64_t count = 1;
};

/// The value of a field at `from`; `swap` reverses its bytes first.
[[nodiscard]] double field_value(const CloudField& field, const char* from, bool swap = false);

/// A file's header and its points.
struct CloudContent {
  std::vector<CloudField> fields;
  std::uint64_t width = 0;
  std::uint64_t height = 1;
  /// "ascii" or the format's word for binary.
  std::string encoding;
  /// Point after point, fields without padding, in this machine's byte order; may be longer than
  /// the points.
  std::string body;

  [[nodiscard]] std::uint64_t points() const { return width * height; }
  [[nodiscard]] std::uint64_t point_bytes() const;
};

/// Of a PCD file: ascii, binary, binary_compressed.
[[nodiscard]] CloudContent read_pcd_content(const std::filesystem::path& file);

/// Of a PLY file whose first element is `vertex`; other elements stay in the body, unread.
[[nodiscard]] CloudContent read_ply_content(const std::filesystem::path& file);

/// A PLY file's header, read up to the first point; `body` stays empty.
[[nodiscard]] CloudContent read_ply_header(const std::filesystem::path& file, std::istream& in);

// What the readers of both formats share: nothing believes a count of a header before the file has
// been found large enough for it.

inline constexpr std::size_t max_header_lines = 1000;
inline constexpr std::uint64_t max_point_bytes = 4096;

using Words = std::vector<std::string>;

/// The words of a header's line.
[[nodiscard]] Words words_of(const std::string& line);

/// The number that is all of a word; nan and inf are numbers.
[[nodiscard]] std::optional<double> number_of(std::string_view word);

/// An unsigned integer of up to nine digits.
[[nodiscard]] std::uint64_t header_count(const std::filesystem::path& file,
                                         const std::string& field, const std::string& word);

/// Checks that the header announces no more points than a scan has and that the body holds
/// `needed_bytes`.
void check_room(const std::filesystem::path& file, const CloudContent& content,
                std::uint64_t needed_bytes);

/// Replaces an ascii body by its numbers, as `body` describes them. Integers that do not fit into
/// their field become 0.
void parse_ascii_body(const std::filesystem::path& file, CloudContent& content);

}  // namespace stillmap
