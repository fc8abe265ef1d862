#pragma once

#include <filesystem>
#include <functional>
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
  /// `file`, the current one to begin with, may be empty: then only named files can be saved.
  /// `metadata` goes into every file.
  MapSaver(const MapBoard& board, std::filesystem::path file,
           std::map<std::string, std::string> metadata);

  /// What the file held; nothing when there is no file. Throws MapFileError.
  [[nodiscard]] std::optional<StoredMap> load();

  /// Saves to the current file, if there is one and scans were mapped
  /// since the last save. Throws MapFileError.
  void save_if_changed();

  /// Saves to `name` beside the configured file, or to the current file when empty; returns where.
  /// Throws MapFileError, or std::invalid_argument for a name that is a path.
  std::filesystem::path save_as(const std::string& name);

  /// Makes `name` the current file: reads the map there, saves the running map to its own file
  /// (after `show_now` put all of it on the board), and hands the other one to `replace_running`,
  /// which puts it on the board. An empty or the current name goes back to the last save. Throws
  /// as save_as, also for a file that is not there or holds no map, and what `replace_running`
  /// throws; the current file is then the one that it was.
  std::filesystem::path go_on_in(const std::string& name, const std::function<void()>& show_now,
                                 const std::function<void(StoredMap)>& replace_running);

 private:
  [[nodiscard]] StoredMap stored_map() const;
  /// Throws std::invalid_argument.
  [[nodiscard]] std::filesystem::path file_named(const std::string& name) const;
  void save_current_if_changed();
  void remember_as_saved(const MapView& view, std::uint64_t poses);

  const MapBoard& board_;
  std::filesystem::path file_;
  std::map<std::string, std::string> metadata_;
  /// Of the current file; what `metadata_` does not say stays as it is.
  std::map<std::string, std::string> stored_metadata_;
  std::mutex mutex_;
  std::unique_ptr<TileStore> store_;
  std::uint64_t saved_map_id_ = 0;
  std::uint64_t saved_version_ = 0;
  std::uint64_t saved_poses_ = 0;
};

}  // namespace stillmap
