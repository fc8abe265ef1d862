#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

namespace stillmap {

// What PCD and PLY headers have in common to be checked: a reader must not believe a count before
// it has seen that the file is large enough for it. All throw DatasetError.

/// Field of a point: kind F (floating), I or U (whole, with or without sign) as PCD names them.
struct CloudField {
  std::string name;
  char kind = 'F';
  std::uint64_t bytes = 4;
  std::uint64_t count = 1;
};

/// A file's header, and all that follows it. `body` is large enough for the points.
struct CloudContent {
  std::vector<CloudField> fields;
  std::uint64_t width = 0;
  std::uint64_t height = 1;
  /// "ascii" or the format's word for binary.
  std::string encoding;
  std::string body;

  [[nodiscard]] std::uint64_t points() const { return width * height; }
  [[nodiscard]] std::uint64_t point_bytes() const;
};

[[nodiscard]] CloudContent read_pcd_content(const std::filesystem::path& file);

/// A PLY file's header, read up to the first point; `body` stays empty.
[[nodiscard]] CloudContent read_ply_header(const std::filesystem::path& file, std::istream& in);

/// Of a PLY file whose first element is `vertex`; other elements stay in the body, unread.
[[nodiscard]] CloudContent read_ply_content(const std::filesystem::path& file);

/// The words of a header's line.
[[nodiscard]] std::vector<std::string> words_of(const std::string& line);

/// A whole number of up to nine digits without sign.
[[nodiscard]] std::uint64_t header_count(const std::filesystem::path& file,
                                         const std::string& field, const std::string& word);

/// That points and their size are a scan's, and the body has room for `needed_bytes`.
void check_room(const std::filesystem::path& file, const CloudContent& content,
                std::uint64_t needed_bytes);

}  // namespace stillmap
