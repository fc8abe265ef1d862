#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/map/map_file.hpp"
#include "server/map_board.hpp"

namespace stillmap {

/// Writes the map on the board to its file. Thread-safe; saves wait for each other.
class MapSaver {
 public:
  /// `file` may be empty: then only named files can be saved. `metadata` goes into every file.
  MapSaver(const MapBoard& board, std::filesystem::path file,
           std::map<std::string, std::string> metadata);

  /// What the file held; nothing when there is no file. Throws MapFileError.
  [[nodiscard]] std::optional<StoredMap> load();

  /// Saves to the configured file, if there is one and scans were mapped
  /// since the last save. Throws MapFileError.
  void save_if_changed();

  /// Saves to `name` beside the configured file, or to that itself when empty; returns where.
  /// Throws MapFileError, or std::invalid_argument for a name that is a path.
  std::filesystem::path save_as(const std::string& name);

 private:
  [[nodiscard]] StoredMap stored_map() const;

  const MapBoard& board_;
  std::filesystem::path file_;
  std::map<std::string, std::string> metadata_;
  std::mutex mutex_;
  std::unique_ptr<TileStore> store_;
  std::uint64_t saved_map_id_ = 0;
  std::uint64_t saved_version_ = 0;
  std::uint64_t saved_poses_ = 0;
};

}  // namespace stillmap
