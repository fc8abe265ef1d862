#pragma once

#include <filesystem>
#include <string>

#include "core/map/storage/map_file.hpp"

namespace stillmap {

/// One that another process writes its map to.
class MapFileInUseError : public MapFileError {
 public:
  using MapFileError::MapFileError;
};

/// Who writes a map file: one process at a time. The file "NAME.lock" beside it names the holder,
/// as "host pid token", and is locked (flock) as long as the holder lives: a lock that a killed
/// process left behind is taken over. Programs that only read need none.
class MapLock {
 public:
  /// Throws MapFileInUseError that names the holder, or MapFileError when the lock file cannot be
  /// written or is something else.
  explicit MapLock(const std::filesystem::path& map_file);
  ~MapLock();
  /// Whether its file still has its name: somebody may have removed it. Some file systems give a
  /// file another inode number while it is open.
  [[nodiscard]] bool is_held() const;
  MapLock(const MapLock&) = delete;
  MapLock& operator=(const MapLock&) = delete;

 private:
  std::filesystem::path lock_file_;
  /// What is written there.
  std::string holder_;
  int descriptor_ = -1;
};

}  // namespace stillmap
