#pragma once

#include <bit>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {

static_assert(std::endian::native == std::endian::little, "KITTI's files are little-endian");

/// More bytes than any scan's file has; a larger one is not a scan.
inline constexpr std::uintmax_t max_scan_file_bytes = std::uintmax_t{1} << 30;

/// The ending of a file's name in small letters: ".pcd".
[[nodiscard]] std::string ending_of(const std::filesystem::path& file);

/// Size of a regular file; throws DatasetError when there is none or it is absurdly large.
[[nodiscard]] std::uintmax_t scan_file_size(const std::filesystem::path& file);

/// Throws DatasetError, with the size of a record and what it is.
[[noreturn]] void throw_truncated(const std::filesystem::path& file, std::uintmax_t size,
                                  std::size_t record_size);

/// A file of nothing but values of one kind, in records of `per_record` values. Throws DatasetError
/// when it cannot be read or its size is no multiple of a record. An empty file gives no values.
template <class T>
[[nodiscard]] std::vector<T> read_values(const std::filesystem::path& file,
                                         std::size_t per_record = 1) {
  static_assert(std::is_trivially_copyable_v<T>);
  const std::uintmax_t size = scan_file_size(file);
  if (size % (sizeof(T) * per_record) != 0) throw_truncated(file, size, sizeof(T) * per_record);
  std::vector<T> values(static_cast<std::size_t>(size) / sizeof(T));
  std::ifstream in(file, std::ios::binary);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(size));
  if (!in) throw DatasetError(file, "cannot be read; check its permissions");
  return values;
}

/// Writes the values and nothing else. Throws DatasetWriteError.
template <class T>
void write_values(const std::filesystem::path& file, std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(values.data()),
            static_cast<std::streamsize>(values.size_bytes()));
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

}  // namespace stillmap
