#include "core/dataset/binary_file.hpp"

#include <algorithm>
#include <cctype>
#include <system_error>

namespace stillmap {

std::string ending_of(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char letter) {
    return static_cast<char>(std::tolower(letter));
  });
  return ending;
}

std::uintmax_t scan_file_size(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw DatasetError(file, "no such file; check the path");
  }
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error) throw DatasetError(file, "cannot be read: " + error.message());
  if (size > max_scan_file_bytes) {
    throw DatasetError(file, "has " + std::to_string(size) +
                                 " bytes, which is more than one scan can have; split the file");
  }
  return size;
}

void throw_truncated(const std::filesystem::path& file, std::uintmax_t size,
                     std::size_t record_size) {
  throw DatasetError(file, "size " + std::to_string(size) + " is no multiple of " +
                               std::to_string(record_size) +
                               " bytes a point; the file is truncated or of another kind, "
                               "copy it again or remove it");
}

}  // namespace stillmap
