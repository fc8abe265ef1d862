#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace stillmap::dds {

/// A file that is read here and there. Not mapped into memory: a file that shrinks meanwhile would
/// end the process.
class InputFile {
 public:
  /// Throws DatasetError.
  explicit InputFile(const std::filesystem::path& file);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// When it was opened.
  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// Fills all of `to`. Throws DatasetError when the file ends before that, or the disk fails.
  void read(std::uint64_t offset, std::span<std::uint8_t> to) const;
  [[nodiscard]] std::vector<std::uint8_t> read(std::uint64_t offset, std::size_t bytes) const;

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace stillmap::dds
