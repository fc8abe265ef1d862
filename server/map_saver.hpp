#pragma once

#include <cstdint>
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

/// A state of map and path to be stored.
struct RunCheckpoint {
  StoredMap map;
  /// How far the map goes; told back when it is stored.
  std::uint64_t step = 0;
};

/// Who maps, as the saver sees it.
struct CheckpointSource {
  /// What changed since what was stored last, or everything.
  std::function<RunCheckpoint(bool everything)> take;
  std::function<void(std::uint64_t step)> stored;
  /// What the static map takes in memory.
  std::function<std::size_t()> map_bytes;
};

/// Writes the map to its file, and with a memory limit keeps there what is not in memory.
/// Thread-safe; saves wait for each other.
class MapSaver {
 public:
  /// `file` may be empty: then only named files can be saved, and tiles that do not fit into memory
  /// go to a file for the run. `metadata` goes into every file. Until `follow` is called, the board
  /// is what is saved. Throws MapFileError.
  MapSaver(const MapBoard& board, std::filesystem::path file,
           std::map<std::string, std::string> metadata, std::uint32_t memory_limit_mib = 0);

  /// What the file held, for mapping to go on from; nothing when there is no file. With a memory
  /// limit, its tiles are away. The map has a new id unless it was saved when its last run ended.
  /// Throws MapFileError.
  [[nodiscard]] std::optional<StoredMap> load();
  /// Where tiles that are away come from; null without a memory limit.
  [[nodiscard]] std::shared_ptr<TileShelf> shelf();
  void follow(CheckpointSource source);

  /// Saves to the configured file, if there is one and scans were mapped since the last save;
  /// without one, what is to leave memory. Throws MapFileError.
  void save_if_changed();
  /// The same when the run has ended.
  void save_at_end();

  /// Saves to `name` beside the configured file, or to that itself when empty; returns where.
  /// Throws MapFileError, or std::invalid_argument for a name that is a path.
  std::filesystem::path save_as(const std::string& name);

 private:
  [[nodiscard]] bool is_saved() const;
  void save(bool has_ended);
  [[nodiscard]] RunCheckpoint take(bool everything) const;

  const MapBoard& board_;
  std::filesystem::path file_;
  std::map<std::string, std::string> metadata_;
  std::size_t memory_limit_bytes_;
  CheckpointSource source_;
  std::mutex mutex_;
  std::unique_ptr<TileStore> store_;
  std::uint64_t saved_map_id_ = 0;
  std::uint64_t saved_version_ = 0;
  std::uint64_t saved_poses_ = 0;
};

}  // namespace stillmap
