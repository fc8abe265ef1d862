#pragma once

#include <filesystem>

namespace stillmap {

/// A folder of a name that nothing had before, removed with all that is in it when the object goes.
class TemporaryFolder {
 public:
  /// Its name is `prefix` and six letters or digits. Throws std::filesystem::filesystem_error.
  explicit TemporaryFolder(const std::filesystem::path& prefix);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// For a process that a signal is about to end: removes all that it has. No thread can make or
  /// remove one after that: it waits for the end.
  static void remove_all_at_end();

 private:
  std::filesystem::path path_;
};

}  // namespace stillmap
