#pragma once

#include <filesystem>
#include <string>

#include "tests/fuzz/fuzz_target.hpp"

namespace stillmap::fuzz {

/// For entries that want a file: a folder of this process in /dev/shm, gone when it ends.
class MemoryFolder {
 public:
  [[nodiscard]] static const MemoryFolder& of_this_process();

  ~MemoryFolder();
  MemoryFolder(const MemoryFolder&) = delete;
  MemoryFolder& operator=(const MemoryFolder&) = delete;

  /// Writes a file of this folder and returns its path.
  std::filesystem::path file(const std::string& name, Bytes bytes) const;
  std::filesystem::path file(const std::string& name, const std::string& text) const;
  /// Where a file of this name would be.
  [[nodiscard]] std::filesystem::path path(const std::string& name) const;
  /// Takes a file out, and what SQLite leaves beside it.
  void remove(const std::string& name) const;

 private:
  MemoryFolder();

  std::filesystem::path folder_;
};

/// All that is in a file.
[[nodiscard]] std::string content_of(const std::filesystem::path& file);

}  // namespace stillmap::fuzz
