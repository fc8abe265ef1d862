#pragma once

#include <filesystem>

#include "core/map/storage/map_file.hpp"
#include "core/process/temporary_folder.hpp"

namespace stillmap {

/// A map file copied into the temporary folder, for reading only: whatever SQLite does when it
/// opens a file (such as replaying the log that a crash left), the original stays as it is, byte
/// for byte. A server may have it open: the copy is its last save.
class MapFileCopy {
 public:
  /// Throws MapFileError: missing, empty, not a file, not readable, or no room for the copy.
  explicit MapFileCopy(std::filesystem::path file);

  [[nodiscard]] const std::filesystem::path& path() const { return copy_; }

  /// Throws MapFileError naming the file, not its copy: not a map file, of a newer version,
  /// damaged.
  void check_format() const;
  /// Throws as check_format does.
  [[nodiscard]] SavedMap load() const;

 private:
  std::filesystem::path file_;
  TemporaryFolder folder_;
  std::filesystem::path copy_;
};

/// The error of a copy as one of the file.
[[nodiscard]] MapFileError error_of(const std::filesystem::path& file,
                                    const std::filesystem::path& copy, const MapFileError& error);

/// What a map file holds, the file left as it is. Throws MapFileError as MapFileCopy does.
[[nodiscard]] SavedMap read_map_file(const std::filesystem::path& file);

}  // namespace stillmap
