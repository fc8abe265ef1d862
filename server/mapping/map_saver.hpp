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
#include <shared_mutex>
#include <string>
#include <vector>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "server/mapping/left_maps.hpp"
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
  /// What of the map is to be stored, and the path.
  [[nodiscard]] virtual RunCheckpoint checkpoint(CheckpointScope scope) = 0;
  /// This checkpoint, the last one taken, is stored: far tiles may be evicted.
  virtual void checkpoint_stored(std::uint64_t step) = 0;
  /// It is not: what changed since the last one is in memory alone.
  virtual void checkpoint_failed() = 0;
  [[nodiscard]] virtual MemoryUse memory_use() = 0;
  /// Evicted tiles that are not in the last checkpoint, which is of everything and not stored yet,
  /// are lost: the map goes on without them. Nothing to do where none are evicted.
  virtual void forget_lost_tiles() {}
  /// What was stored is not there any more: nothing that is in memory may be evicted.
  virtual void stored_is_gone() {}
};

/// The map that a reset began.
struct NewMap {
  std::uint64_t map_id = 0;
  /// Where the map until then is kept; empty when it is not.
  std::filesystem::path kept_file;
};

/// The tiles of one map, whose file may have to be moved under it. Thread-safe.
class MovableTileStore : public TileStore {
 public:
  explicit MovableTileStore(std::shared_ptr<TileStore> store) : store_(std::move(store)) {}
  /// Closes the file for `move`, which returns where it lies after that. SQLite keeps to the log
  /// that lay beside an open file.
  void move_file(const std::function<std::filesystem::path()>& move) {
    const std::scoped_lock lock(mutex_);
    store_.reset();
    file_ = move();
  }
  TileRecord load(TileId id) override {
    {
      // The mapper does not wait for other readers.
      const std::shared_lock lock(mutex_);
      if (store_) return store_->load(id);
    }
    const std::scoped_lock lock(mutex_);
    if (!store_) store_ = open_tile_store(file_);
    return store_->load(id);
  }

 private:
  std::shared_mutex mutex_;
  /// Null until it is needed, once it was moved.
  std::shared_ptr<TileStore> store_;
  std::filesystem::path file_;
};

/// Bytes that may be written in an hour, beginning with an hour's worth. Not thread-safe.
class WriteAllowance {
 public:
  /// 0: any number of bytes.
  explicit WriteAllowance(std::uint64_t bytes_per_hour)
      : bytes_per_hour_(static_cast<double>(bytes_per_hour)), left_(bytes_per_hour_) {}

  /// Whether something may be written now; it may be larger than what is left, and is paid off
  /// before the next.
  [[nodiscard]] bool is_open(MonotonicClock::TimePoint now);
  /// What had to be written beyond it is paid off within two hours.
  void spend(std::uint64_t bytes) {
    left_ = std::max(left_ - static_cast<double>(bytes), -bytes_per_hour_);
  }

 private:
  double bytes_per_hour_;
  double left_;
  std::optional<MonotonicClock::TimePoint> refilled_;
};

/// What a MapSaver is to keep to.
struct MapSaverLimits {
  /// 0: all of the map stays in memory.
  std::uint32_t memory_limit_mib = 0;
  /// Written while the robot stands and its map hardly changes; 0: no limit.
  std::uint32_t standing_mib_per_hour = 0;
  SavedMapsLimit saved_maps = {};
  /// How runs that resume a stored map are remembered in its file.
  RunSession session = {};
};

/// Writes the map to its file, and with a memory limit keeps there what is not in memory. A file
/// never gets another map's content: a map that gives way to a new one keeps a file of its own, and
/// one whose file was removed, or another one put there, is written anew: under its name where that
/// is free, else under one with the time.
/// While the robot stands, checkpoints hold the tiles whose view changed by more than a few voxels;
/// what else a standing lidar gathers (counts, times, poses) is written as far as the allowance
/// goes. Thread-safe; saves wait for each other.
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
           std::map<std::string, std::string> metadata, const MapSaverLimits& limits = {},
           MonotonicClock& clock = MonotonicClock::steady());

  /// What the file holds, for mapping to resume from; nothing when there is no file. With a memory
  /// limit, its tiles are non-resident. The map has a new id. Throws MapFileError, and what `check`
  /// throws of what the file holds, which then stays as it is.
  [[nodiscard]] std::optional<SavedMap> load(
      const std::function<void(const MapSnapshot&)>& check = {});
  /// Instead of `load`: a map that the file holds is renamed, and the file empty from now on.
  /// Returns the map's new name; nothing where the file holds none. Throws MapFileError.
  std::optional<std::filesystem::path> set_saved_map_aside();
  /// Backing store of tiles that are evicted from memory; null without a memory limit.
  [[nodiscard]] std::shared_ptr<TileStore> tile_store();

  /// Saves come from there; called once, before any of them. `source` must outlive the last.
  void set_source(CheckpointSource& source);

  /// Saves to the current file, if there is one and the map changed since the last save; without
  /// one, to the temporary file when memory is running out. Throws MapFileError.
  void save_if_changed();
  /// The same when the run has ended: everything is stored.
  void save_at_end();
  /// Stores everything, so that tiles can be evicted. Throws MapFileError.
  void make_room();

  /// Saves to `name` beside the configured file, or to the current file when empty; returns where.
  /// Throws MapFileError, std::invalid_argument for a name that is a path, or RefusedNow for one
  /// that another map has already unless `overwrite`, beyond the limit of saved maps, and for a map
  /// that is empty.
  std::filesystem::path save_as(const std::string& name, bool overwrite = false);

  /// Makes `name` the current file: reads and prepares the map there under a new id, saves the
  /// running map to its own file, and lets the other one take its place. An empty name or that of
  /// the current file returns to the last save, or to what somebody put in the file's place. Throws
  /// as save_as, also for a file that does not exist, cannot be written or holds no map, for a
  /// running map that has no file and was never saved, and what `prepare` throws; then the running
  /// map goes on, and its file stays its own.
  std::filesystem::path resume_from(const std::string& name, const PrepareMap& prepare);

  /// Lets an empty map begin. The running map is saved, and kept beside the current file, which is
  /// the new map's; with `discard`, it is gone. Throws as save_as, and RefusedNow for a running map
  /// that has no file and was never saved, unless `discard`; then the running map goes on.
  NewMap begin_anew(bool discard, const BeginMap& begin);

 private:
  /// Opens it again where that failed before, and writes the map anew where its file was removed or
  /// another one put there.
  [[nodiscard]] MapStore& open_store();
  /// Throws MapFileError where the map cannot be written anew; it is tried again with the next use.
  void look_after_file();
  /// The same before a save, a load or a reset: what it throws counts as a checkpoint that failed.
  void look_after_file_first();
  void count_failure(const std::exception& error);
  /// False where it is kept after all.
  [[nodiscard]] bool write_anew(MapFileFate fate);
  /// The name that a map gets which cannot have its own. Throws MapFileError beyond the limit of
  /// saved maps, unless the run has ended.
  [[nodiscard]] std::filesystem::path name_beside() const;
  /// False where the name is another file's, or another server's, or cannot be written.
  [[nodiscard]] bool take_name_again();
  /// Of a file that is kept: takes its lock again where somebody removed it. False where another
  /// process has it.
  [[nodiscard]] bool keep_lock();
  void tell_of_left_maps();
  /// Tells of a configured link that leads to another file by now.
  void tell_where_name_leads();
  /// Goes on in the file itself, or a copy of its last state, that has the name, or that a link of
  /// that name leads to. False where neither is there.
  [[nodiscard]] bool follow_name();
  void move_to(const std::filesystem::path& target, std::unique_ptr<MapLock> target_lock);
  /// From now on the map's file, and what is kept beside it, is where `name` leads.
  void follow_to(const std::filesystem::path& target, const std::filesystem::path& name);
  /// A file that was made beside the map's name, and never got anything to hold.
  void remove_if_empty(const std::filesystem::path& made_beside);
  /// Tiles that were in the file alone are lost with its content.
  void write_anew_from_memory();
  /// The next file to be opened is `target`; the one that was open is somebody else's, and its log
  /// stays where another process has that open.
  void leave_store_for(const std::filesystem::path& target, bool is_log_of_another = false);
  /// Somebody removed the lock of the current file, and another process has it by now.
  [[nodiscard]] bool is_locked_by_another() const;
  void leave_name();
  void leave_out_lost_tiles(SavedMap& map);
  /// A map without a file that was never saved. Throws RefusedNow.
  void refuse_to_lose() const;
  [[nodiscard]] SavedMap read(MapStore& store) const;
  /// All that a checkpoint in the present scope would store.
  [[nodiscard]] bool is_saved() const;
  /// All that is known, a standing robot's evidence included.
  [[nodiscard]] bool is_saved_whole() const { return is_saved() && !is_partial_; }
  /// Everything that changed, or what matters while the robot stands.
  [[nodiscard]] CheckpointScope scope();
  [[nodiscard]] bool has_moved() const;
  /// Counts the save and times it.
  void save(CheckpointScope scope, bool has_ended = false);
  /// False where there was nothing to write.
  bool store(CheckpointScope scope, bool has_ended);
  [[nodiscard]] RunCheckpoint take(CheckpointScope scope) const;
  /// The current file when empty. Throws std::invalid_argument for what is no plain name,
  /// RefusedNow where there is no current file.
  [[nodiscard]] std::filesystem::path file_named(const std::string& name) const;
  void save_copy(const std::filesystem::path& target, bool overwrite);
  [[nodiscard]] bool is_empty() const {
    // There is no view before mapping begins.
    const auto view = latest_map_.view();
    return (!view || view->tiles.empty()) && latest_map_.poses_stored() == 0;
  }
  /// Renames the current file, and puts an empty one in its place, whose tiles it returns. Throws
  /// MapFileError; then the current file is what it was, or becomes it again with the next use that
  /// the disk allows.
  std::shared_ptr<MovableTileStore> put_aside(const std::filesystem::path& kept);
  /// Undoes `put_aside` where it failed half-way.
  void bring_back();
  /// What the map that the file holds is to read its tiles from; null without a memory limit.
  [[nodiscard]] std::shared_ptr<MovableTileStore> tiles_of(MapStore& store) const;
  void remember_as_saved(const MapSnapshot& view, std::uint64_t poses);
  /// Of the current file; what `metadata_` does not say stays as it is.
  void remember_metadata(const SavedMap& map);

  const LatestMap& latest_map_;
  Statistics& statistics_;
  std::filesystem::path file_;
  /// As it was configured, which may be a link, and the file that it is taken to lead to.
  std::filesystem::path configured_name_;
  std::filesystem::path configured_file_;
  MapFolder folder_;
  std::unique_ptr<MapLock> lock_;
  LeftMaps left_maps_;
  std::map<std::string, std::string> metadata_;
  std::map<std::string, std::string> stored_metadata_;
  std::size_t memory_limit_bytes_;
  RunSession session_;
  /// The running map is one that was stored before this run.
  bool is_session_ = false;
  CheckpointSource* source_ = nullptr;
  std::mutex mutex_;
  std::unique_ptr<MapStore> store_;
  /// Of the running map.
  std::shared_ptr<MovableTileStore> tiles_;
  /// Where the current file lies while it could not be given its name again.
  std::optional<std::filesystem::path> misplaced_;
  /// The name that the running map had until somebody put another file there.
  std::optional<std::filesystem::path> left_file_;
  /// A load without a name means that file.
  bool is_left_file_loaded_ = false;
  bool has_ended_ = false;
  /// The file's content is gone, and nothing was saved since.
  bool is_memory_alone_ = false;
  ThrottledLog throttled_log_;
  /// The map without a file that was saved under a name last.
  std::uint64_t copied_map_id_ = 0;
  std::uint64_t saved_map_id_ = 0;
  std::uint64_t saved_version_ = 0;
  std::uint64_t saved_poses_ = 0;
  /// Corrections of the path that are stored whole.
  std::uint64_t saved_corrections_ = 0;
  /// The last save left out what a standing robot gathered.
  bool is_partial_ = false;
  WriteAllowance standing_allowance_;
  MonotonicClock& clock_;
  /// Where the robot was when everything was stored last.
  std::optional<Eigen::Isometry3d> T_map_base_saved_;
};

/// How long after the begin of a save the next one is due: the next one is to have ended `period`
/// after this one began, so that a killed server loses no more than that. `longest` is the longest
/// of the last saves. At least half of the period.
[[nodiscard]] std::chrono::duration<double> due_after_begin(std::chrono::duration<double> period,
                                                            std::chrono::duration<double> longest);

/// Calls `save` again and again on a thread of its own until destroyed. Logs what it
/// throws.
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
