#pragma once

#include <filesystem>
#include <vector>

#include "core/process/temporary_folder.hpp"

namespace stillmap {

/// A map file that is made beside the one whose place it is to take, or which a link of that name
/// leads to. It lies in a folder of its
/// own, "NAME.new-" and six letters more, so that neither it nor what SQLite puts beside it is ever
/// a file of somebody else. Where it did not take the place, it goes with the object.
class FreshMapFile {
 public:
  /// Throws std::filesystem::filesystem_error.
  explicit FreshMapFile(const std::filesystem::path& file);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  TemporaryFolder folder_;
  std::filesystem::path path_;
};

/// Removes what killed processes left of such folders. For who holds the lock of the file (MapLock)
/// and has made none yet.
void remove_left_fresh_files(const std::filesystem::path& file);

/// The fresh files that were to be put beside `file` under a longer name, as that of
/// "city.2026-05-31_142500.stillmap" beside "city.stillmap". A process that was killed left them,
/// or one makes them now; each may be whole.
[[nodiscard]] std::vector<std::filesystem::path> fresh_files_beside(
    const std::filesystem::path& file);

}  // namespace stillmap
