#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace stillmap::dds {

/// What is in one zstd frame. Throws CdrError for bytes that are no whole frame, or hold more than
/// a message can (1 GiB).
[[nodiscard]] std::vector<std::uint8_t> decompressed(std::span<const std::uint8_t> frame);

/// Unpacks a file, piece by piece. Throws DatasetError for a damaged file, or when `to` cannot be
/// written.
void decompress_file(const std::filesystem::path& from, const std::filesystem::path& to);

/// A folder of its own that goes away with this.
class TemporaryFolder {
 public:
  /// Throws DatasetError.
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace stillmap::dds
