#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/map/storage/map_file.hpp"
#include "server/monitoring/checkpoint_log.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap::server {

/// A state of map and path to be stored.
struct RunCheckpoint {
  SavedMap map;
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
  using ReplaceRunning =
      std::function<void(const SavedMap& map, const std::shared_ptr<TileStore>& tile_store)>;

  /// `file`, the current one to begin with, may be empty: then only named files can be saved, and
  /// tiles that do not fit into memory go to a file for the run. `metadata` goes into every file.
  /// Until `set_source` is called, the latest map is what is saved. Throws MapFileError.
  MapSaver(const LatestMap& latest_map, std::filesystem::path file,
           std::map<std::string, std::string> metadata, std::uint32_t memory_limit_mib = 0);

  /// What the file held, for mapping to go on from; nothing when there is no file. With a memory
  /// limit, its tiles are non-resident. The map has a new id unless it was saved when its last run
  /// ended. Throws MapFileError.
  [[nodiscard]] std::optional<SavedMap> load();
  /// Where tiles that are non-resident come from; null without a memory limit.
  [[nodiscard]] std::shared_ptr<TileStore> tile_store();
  void set_source(CheckpointSource source);

  /// Saves to the current file, if there is one and scans were mapped since the last save; without
  /// one, what is to leave memory. Throws MapFileError.
  void save_if_changed();
  /// The same when the run has ended.
  void save_at_end();

  /// Saves to `name` beside the configured file, or to the current file when empty; returns where.
  /// Throws MapFileError, or std::invalid_argument for a name that is a path.
  std::filesystem::path save_as(const std::string& name);

  /// Makes `name` the current file: reads the map there, saves the running map to its own file, and
  /// hands the other one, under a new id, to `replace_running`, which publishes it. An
  /// empty or the current name goes back to the last save. Throws as save_as, also for a file that
  /// is not there or holds no map, and what `replace_running` throws; the current file is then the
  /// one that it was.
  std::filesystem::path resume_from(const std::string& name, const ReplaceRunning& replace_running);

  /// Saves to the current file so far.
  [[nodiscard]] CheckpointLog::Record checkpoints() const { return checkpoints_.record(); }

 private:
  [[nodiscard]] SavedMap read(MapStore& store) const;
  [[nodiscard]] bool is_saved() const;
  void save(bool has_ended);
  [[nodiscard]] RunCheckpoint take(bool everything) const;
  /// Throws std::invalid_argument.
  [[nodiscard]] std::filesystem::path file_named(const std::string& name) const;
  void remember_as_saved(const MapSnapshot& view, std::uint64_t poses);
  /// Of the current file; what `metadata_` does not say stays as it is.
  void remember_metadata(const SavedMap& map);

  const LatestMap& latest_map_;
  std::filesystem::path file_;
  std::map<std::string, std::string> metadata_;
  std::map<std::string, std::string> stored_metadata_;
  std::size_t memory_limit_bytes_;
  CheckpointSource source_;
  CheckpointLog checkpoints_;
  std::mutex mutex_;
  std::unique_ptr<MapStore> store_;
  std::uint64_t saved_map_id_ = 0;
  std::uint64_t saved_version_ = 0;
  std::uint64_t saved_poses_ = 0;
};

}  // namespace stillmap::server
