#pragma once

#include <filesystem>
#include <system_error>

namespace stillmap {

/// A file that is written beside the one that it becomes, as FILE.unfinished, or where that is
/// somebody else's as FILE.unfinished-UID: one that is there stays as it is until the new one is
/// whole, also where the process is killed or finds no room. The new one gets its permissions.
/// Where there is no beside (a pipe or device, a file in a folder that takes no other one) it is
/// the file itself.
class FileBeside {
 public:
  /// A link stays a link: what it leads to is replaced.
  explicit FileBeside(const std::filesystem::path& file);
  /// Removes what did not get its place.
  ~FileBeside();
  FileBeside(const FileBeside&) = delete;
  FileBeside& operator=(const FileBeside&) = delete;

  /// Where to write.
  [[nodiscard]] const std::filesystem::path& path() const { return written_; }

  /// Gives what was written, and closed since, its place; the file system's error where that fails.
  [[nodiscard]] std::error_code put_in_place();

 private:
  std::filesystem::path file_;
  std::filesystem::path written_;
};

}  // namespace stillmap
