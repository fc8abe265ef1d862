#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "server/mapping/map_folder.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// A state of map and path to be stored.
struct RunCheckpoint {
  SavedMap map;
  /// Number of the checkpoint, for `checkpoint_stored`.
  std::uint64_t step = 0;
};

/// The running map, as the saver sees it.
class CheckpointSource {
 public:
  virtual ~CheckpointSource() = default;
  /// What changed since the last stored checkpoint, or everything, and the path up to it.
  [[nodiscard]] virtual RunCheckpoint checkpoint(bool everything) = 0;
  /// Everything up to this checkpoint is stored: far tiles may be evicted.
  virtual void checkpoint_stored(std::uint64_t step) = 0;
  /// It is not: what changed since the last one is in memory alone.
  virtual void checkpoint_failed() = 0;
  [[nodiscard]] virtual MemoryUse memory_use() = 0;
};

/// The map that a reset began.
struct NewMap {
  std::uint64_t map_id = 0;
  /// Where the map until then is kept; empty when it is not.
  std::filesystem::path kept_file;
};

/// Writes the map to its file, and with a memory limit keeps there what is not in memory. A file
/// never gets another map's content: a map that gives way to a new one keeps a file of its own.
/// Thread-safe; saves wait for each other.
class MapSaver {
 public:
  /// Makes a stored map ready to run; what it returns publishes it in the running one's place, and
  /// cannot fail.
  using PrepareMap = std::function<std::function<void()>(
      const SavedMap& map, const std::shared_ptr<TileStore>& tile_store)>;
  /// Publishes a new, empty map.
  using BeginMap =
      std::function<void(std::uint64_t map_id, const std::shared_ptr<TileStore>& tile_store)>;

  /// `file`, the current one to begin with, may be empty: then only named files can be saved, and
  /// tiles that do not fit into memory go to a temporary file. `metadata` goes into every file.
  /// Throws MapFileError, also for a file that another process saves its map to.
  MapSaver(const LatestMap& latest_map, Statistics& statistics, const std::filesystem::path& file,
           std::map<std::string, std::string> metadata, std::uint32_t memory_limit_mib = 0,
           const SavedMapsLimit& saved_maps_limit = {});

  /// What the file holds, for mapping to resume from; nothing when there is no file. With a memory
  /// limit, its tiles are non-resident. The map has a new id unless it was saved when its last run
  /// ended. Throws MapFileError.
  [[nodiscard]] std::optional<SavedMap> load();
  /// Instead of `load`: a map that the file holds is renamed, and the file empty from now on.
  /// Returns the map's new name; nothing where the file holds none. Throws MapFileError.
  std::optional<std::filesystem::path> put_stored_map_aside();
  /// Backing store of tiles that are evicted from memory; null without a memory limit.
  [[nodiscard]] std::shared_ptr<TileStore> tile_store();

  /// Saves come from there; called once, before any of them. `source` must outlive the last.
  void set_source(CheckpointSource& source);

  /// Saves to the current file, if there is one and scans were mapped since the last save; without
  /// one, to the temporary file when memory is running out. Throws MapFileError.
  void save_if_changed();
  /// The same when the run has ended.
  void save_at_end();

  /// Saves to `name` beside the configured file, or to the current file when empty; returns where.
  /// Throws MapFileError, or std::invalid_argument for a name that is a path, one that another map
  /// has already unless `overwrite`, beyond the limit of saved maps, and for a map that is empty.
  std::filesystem::path save_as(const std::string& name, bool overwrite = false);

  /// Makes `name` the current file: reads and prepares the map there under a new id, saves the
  /// running map to its own file, and lets the other one take its place. An empty name or that of
  /// the current file returns to the last save. Throws as save_as, also for a file that does not
  /// exist, cannot be written or holds no map, and what `prepare` throws; then the running map goes
  /// on, and its file stays its own.
  std::filesystem::path resume_from(const std::string& name, const PrepareMap& prepare);

  /// Lets an empty map begin. The running map is saved, and kept beside the current file, which is
  /// the new map's; with `discard`, it is gone. Throws as save_as; then the running map goes on.
  NewMap begin_anew(bool discard, const BeginMap& begin);

 private:
  /// Opens it again where that failed before.
  [[nodiscard]] MapStore& open_store();
  [[nodiscard]] SavedMap read(MapStore& store) const;
  [[nodiscard]] bool is_saved() const;
  /// Counts the save and times it.
  void save(bool has_ended);
  void store(bool has_ended);
  [[nodiscard]] RunCheckpoint take(bool everything) const;
  /// The current file when empty. Throws std::invalid_argument.
  [[nodiscard]] std::filesystem::path file_named(const std::string& name) const;
  void save_copy(const std::filesystem::path& target, bool overwrite);
  [[nodiscard]] bool is_empty() const;
  /// Renames the current file, and puts an empty one in its place.
  void put_aside(const std::filesystem::path& kept);
  void remember_as_saved(const MapSnapshot& view, std::uint64_t poses);
  /// Of the current file; what `metadata_` does not say stays as it is.
  void remember_metadata(const SavedMap& map);

  const LatestMap& latest_map_;
  Statistics& statistics_;
  std::filesystem::path file_;
  MapFolder folder_;
  std::unique_ptr<MapLock> lock_;
  std::map<std::string, std::string> metadata_;
  std::map<std::string, std::string> stored_metadata_;
  std::size_t memory_limit_bytes_;
  CheckpointSource* source_ = nullptr;
  std::mutex mutex_;
  std::unique_ptr<MapStore> store_;
  std::uint64_t saved_map_id_ = 0;
  std::uint64_t saved_version_ = 0;
  std::uint64_t saved_poses_ = 0;
};

/// How long after the begin of a save the next one is due: the next one is to have ended `period`
/// after this one began, so that a killed server loses no more than that. `longest` is the longest
/// of the last saves. At least half of the period.
[[nodiscard]] std::chrono::duration<double> due_after_begin(std::chrono::duration<double> period,
                                                            std::chrono::duration<double> longest);

/// Calls `save` again and again on a thread of its own until destroyed. Logs the MapFileErrors that
/// it throws.
class CheckpointWorker {
 public:
  CheckpointWorker(std::chrono::duration<double> period, std::function<void()> save,
                   MonotonicClock& clock = MonotonicClock::steady());

 private:
  [[nodiscard]] MonotonicClock::TimePoint save_and_schedule();

  std::chrono::duration<double> period_;
  std::function<void()> save_;
  MonotonicClock& clock_;
  std::deque<std::chrono::duration<double>> durations_;
  ThrottledLog throttled_log_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
