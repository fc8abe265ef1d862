#include "server/mapping/map_saver.hpp"

#include <algorithm>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "core/map/map_id.hpp"
#include "core/map/storage/fresh_map_file.hpp"

namespace stillmap::server {
namespace {

namespace fs = std::filesystem;

/// A robot that has gone no farther stands [m], [rad].
constexpr double standing_distance_m = 0.5;
constexpr double standing_angle_rad = 0.2;

constexpr const char* no_map_yet = "holds no map yet; name a file that a map was saved to";

/// Opens an existing file; open_map_file would create a missing one.
std::unique_ptr<MapStore> open_existing(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) {
    throw MapFileError(file, "is not there; a map to be loaded must lie in the folder " +
                                 file.parent_path().string());
  }
  if (fs::is_regular_file(file, error) && fs::file_size(file, error) == 0) {
    throw MapFileError(file, no_map_yet);
  }
  return open_map_file(file);
}

/// A map that uses more of its limit has far tiles that eviction could not take: it begins at 7/8
/// of the map's share (MapTiles::evict), which is 3/4 of the limit.
constexpr double eviction_share = 2.0 / 3.0;

}  // namespace

MapSaver::MapSaver(const LatestMap& latest_map, Statistics& statistics, const fs::path& file,
                   std::map<std::string, std::string> metadata, const MapSaverLimits& limits,
                   MonotonicClock& clock)
    : latest_map_(latest_map),
      statistics_(statistics),
      file_(file.empty() ? file : real_file(file)),
      configured_name_(file.empty() ? file : fs::absolute(file)),
      configured_file_(file_),
      folder_(file_, limits.saved_maps),
      metadata_(std::move(metadata)),
      memory_limit_bytes_(std::size_t{limits.memory_limit_mib} << 20),
      session_(limits.session),
      standing_allowance_(std::uint64_t{limits.standing_mib_per_hour} << 20),
      clock_(clock) {
  // Opened at the start, so that a file that cannot be written is noticed before mapping begins.
  if (!file_.empty()) {
    lock_ = std::make_unique<MapLock>(file_);
    // A map that was to get the name is to be opened, and no new one made.
    left_maps_ = LeftMaps(file_, folder_);
    tell_of_left_maps();
    store_ = open_map_file(file_);
  } else if (memory_limit_bytes_ > 0) {
    store_ = open_scratch_map();
  }
}

MapStore& MapSaver::open_store() {
  if (misplaced_) bring_back();
  look_after_file();
  if (store_) return *store_;
  auto store = open_map_file(file_);
  // What the run changes from here on is another session.
  if (is_session_) store->begin_run(saved_map_id_, session_);
  store_ = std::move(store);
  return *store_;
}

std::optional<SavedMap> MapSaver::load(const std::function<void(const MapSnapshot&)>& check) {
  const std::scoped_lock lock(mutex_);
  if (file_.empty()) return std::nullopt;
  SavedMap map = read(*store_);
  if (check && !map.view.tiles.empty()) check(map.view);
  // Clients may have seen later versions than the stored one: of a run that was killed, or, where
  // the file is a backup that was copied back, of one that ended well. Under a new id, the versions
  // that follow cannot be confused with those.
  map.view.map_id = new_map_id();
  store_->begin_run(map.view.map_id, session_);
  is_session_ = !map.view.tiles.empty();
  if (!map.view.tiles.empty()) remember_as_saved(map.view, latest_map_.poses_added());
  remember_metadata(map);
  return map;
}

SavedMap MapSaver::read(MapStore& store) const {
  return memory_limit_bytes_ > 0 ? store.load_non_resident() : store.load();
}

std::optional<fs::path> MapSaver::set_saved_map_aside() {
  const std::scoped_lock lock(mutex_);
  if (file_.empty() || !store_->holds_map()) return std::nullopt;
  const fs::path kept = folder_.unused_file_for(file_);
  put_aside(kept);
  return kept;
}

std::shared_ptr<TileStore> MapSaver::tile_store() {
  const std::scoped_lock lock(mutex_);
  // All readers of the running map have the same.
  if (memory_limit_bytes_ > 0 && !tiles_) tiles_ = tiles_of(open_store());
  return tiles_;
}

std::shared_ptr<MovableTileStore> MapSaver::tiles_of(MapStore& store) const {
  if (memory_limit_bytes_ == 0) return nullptr;
  return std::make_shared<MovableTileStore>(store.tile_store());
}

void MapSaver::set_source(CheckpointSource& source) {
  const std::scoped_lock lock(mutex_);
  source_ = &source;
}

void MapSaver::save_if_changed() {
  const std::scoped_lock lock(mutex_);
  look_after_file_first();
  if ((!store_ && file_.empty()) || is_saved()) return;
  // A temporary file is only there to make room in memory.
  if (file_.empty() && source_->memory_use().bytes < memory_limit_bytes_ / 2) return;
  save(scope());
}

void MapSaver::save_at_end() {
  const std::scoped_lock lock(mutex_);
  if (misplaced_) bring_back();
  // The map is not to be lost for a limit of what clients save.
  has_ended_ = true;
  look_after_file_first();
  // Nothing mapped: an empty map must not replace what the file holds.
  const bool is_map_empty = latest_map_.poses_added() == 0 && latest_map_.view()->tiles.empty();
  if (!file_.empty() && !(is_map_empty && is_saved())) save(CheckpointScope::changed, true);
  remove_if_empty(file_);
}

void MapSaver::make_room() {
  const std::scoped_lock lock(mutex_);
  if (store_ || !file_.empty()) save(CheckpointScope::changed);
}

CheckpointScope MapSaver::scope() {
  // Evidence that is not stored cannot be evicted.
  const bool is_full =
      memory_limit_bytes_ > 0 && static_cast<double>(source_->memory_use().bytes) >
                                     eviction_share * static_cast<double>(memory_limit_bytes_);
  if (is_full || has_moved() || standing_allowance_.is_open(clock_.now())) {
    return CheckpointScope::changed;
  }
  return CheckpointScope::changed_views;
}

bool MapSaver::has_moved() const {
  if (!T_map_base_saved_ || latest_map_.view()->map_id != saved_map_id_) return true;
  // A part of a corrected map with a part of the one before is none.
  if (latest_map_.corrections() != saved_corrections_) return true;
  const Eigen::Isometry3d motion =
      T_map_base_saved_->inverse() * latest_map_.newest_pose().T_map_lidar;
  return motion.translation().norm() > standing_distance_m ||
         Eigen::AngleAxisd(motion.linear()).angle() > standing_angle_rad;
}

bool MapSaver::is_saved() const {
  if (misplaced_) return false;
  const auto view = latest_map_.view();
  const std::uint64_t poses = latest_map_.poses_added();
  const bool is_nothing_mapped = poses == 0 && view->tiles.empty();
  return is_nothing_mapped ||
         (view->map_id == saved_map_id_ && view->version == saved_version_ &&
          poses == saved_poses_ && latest_map_.corrections() == saved_corrections_);
}

void MapSaver::save(CheckpointScope scope, bool has_ended) {
  const auto began = std::chrono::steady_clock::now();
  try {
    if (!store(scope, has_ended)) return;
    // Somebody may have put another file there meanwhile.
    look_after_file();
    if (saved_map_id_ == 0) store(CheckpointScope::everything, has_ended);
  } catch (const std::exception& error) {
    count_failure(error);
    throw;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  statistics_.map_saved(took.count());
}

bool MapSaver::store(CheckpointScope scope, bool has_ended) {
  MapStore& file = open_store();
  const std::uint64_t poses = latest_map_.poses_added();
  const std::uint64_t corrections = latest_map_.corrections();
  const bool is_standing = !has_moved();
  const Eigen::Isometry3d T_map_base = latest_map_.newest_pose().T_map_lidar;
  RunCheckpoint checkpoint = take(scope);
  // The map was corrected since the scope was chosen: a part of it with a part of the one before
  // is none.
  if (scope == CheckpointScope::changed_views && latest_map_.corrections() != corrections) {
    scope = CheckpointScope::changed;
    checkpoint = take(scope);
  }
  // Nothing is stored yet of another map.
  if (checkpoint.map.view.map_id != saved_map_id_) {
    if (saved_map_id_ != 0) throw MapFileError(file_, "holds another map than the running one");
    scope = CheckpointScope::everything;
    checkpoint = take(scope);
  }
  checkpoint.map.is_partial = scope == CheckpointScope::changed_views;
  if (checkpoint.map.is_partial && checkpoint.map.tile_evidence.empty()) return false;
  if (has_ended) checkpoint.map.metadata[map_ended_key] = "yes";
  leave_out_lost_tiles(checkpoint.map);
  // Since the begin, the mapper was waited for.
  if (file.fate() == MapFileFate::overwritten) {
    throw MapFileError(file_, "was overwritten just now; nothing was written to it");
  }
  const std::uint64_t bytes = file.save(checkpoint.map);
  source_->checkpoint_stored(checkpoint.step);
  remember_as_saved(checkpoint.map.view, poses);
  if (is_standing) standing_allowance_.spend(bytes);
  is_partial_ = checkpoint.map.is_partial;
  if (!is_partial_) {
    T_map_base_saved_ = T_map_base;
    saved_corrections_ = corrections;
  }
  return true;
}

void MapSaver::remember_as_saved(const MapSnapshot& view, std::uint64_t poses) {
  saved_map_id_ = view.map_id;
  saved_version_ = view.version;
  saved_poses_ = poses;
}

void MapSaver::remember_metadata(const SavedMap& map) {
  stored_metadata_ = map.metadata;
  stored_metadata_.erase(map_ended_key);
}

fs::path MapSaver::file_named(const std::string& name) const {
  if (file_.empty() && name.empty()) {
    throw RefusedNow(
        "no map file is configured; set map.file in the server's configuration or --map-file");
  }
  return name.empty() ? file_ : real_file(folder_.file_named(name));
}

fs::path MapSaver::save_as(const std::string& name, bool overwrite) {
  const std::scoped_lock lock(mutex_);
  look_after_file_first();
  fs::path target = file_named(name);
  if (is_empty()) {
    throw RefusedNow("the map is empty: no scan was mapped yet; nothing is saved");
  }
  if ((store_ || !file_.empty()) && !is_saved_whole()) save(CheckpointScope::changed);
  if (target != file_) save_copy(target, overwrite);
  if (file_.empty()) copied_map_id_ = latest_map_.view()->map_id;
  // Whoever saved was told where.
  is_left_file_loaded_ = false;
  return target;
}

void MapSaver::save_copy(const fs::path& target, bool overwrite) {
  std::error_code unknown;
  const bool is_there = fs::exists(target, unknown);
  if (is_there && !is_map_file(target)) {
    throw RefusedNow(target.string() + " is there already and no map file; name another file");
  }
  if (is_there && !overwrite) {
    throw RefusedNow(target.string() +
                     " holds a map already; name another file, or ask for it to be "
                     "overwritten (stillmap save --overwrite)");
  }
  const MapLock target_lock(target);
  remove_useless_fresh_files(target);
  const std::uintmax_t bytes = file_.empty() ? 0 : fs::file_size(file_, unknown);
  folder_.check_room(file_, target, unknown ? 0 : bytes);
  if (store_ || !file_.empty()) {
    MapStore& store = open_store();
    store.copy_to(target);
    if (!file_.empty() && store.fate() == MapFileFate::overwritten) {
      throw MapFileError(file_, "was overwritten while it was copied; save again");
    }
    return;
  }
  const std::unique_ptr<MapStore> scratch = open_scratch_map();
  scratch->save(take(CheckpointScope::everything).map);
  scratch->copy_to(target);
}

void MapSaver::refuse_to_lose() const {
  if (!file_.empty() || is_empty() || copied_map_id_ == latest_map_.view()->map_id) return;
  throw RefusedNow(
      "this server keeps its map in no file, and it would be lost: 'stillmap save NAME' first "
      "('stillmap reset --discard' where it is not wanted)");
}

fs::path MapSaver::resume_from(const std::string& name, const PrepareMap& prepare) {
  const std::scoped_lock lock(mutex_);
  // It belongs under the name that the saver is about to leave.
  if (misplaced_) bring_back();
  look_after_file_first();
  // A link may have taken that name meanwhile.
  const bool is_left_file = name.empty() && left_file_ && is_left_file_loaded_;
  fs::path target = is_left_file ? real_file(*left_file_) : file_named(name);
  refuse_to_lose();
  const bool is_own = target == file_;
  auto target_lock = is_own ? nullptr : std::make_unique<MapLock>(target);
  auto store = is_own ? nullptr : open_existing(target);
  MapStore& source = is_own ? open_store() : *store;
  SavedMap map = read(source);
  if (map.view.tiles.empty()) throw MapFileError(target, no_map_yet);
  map.view.map_id = new_map_id();
  const std::shared_ptr<MovableTileStore> tiles = tiles_of(source);
  const auto begin = prepare(map, tiles);
  if (!is_own && !file_.empty() && !is_empty() && !is_saved_whole()) {
    save(CheckpointScope::changed);
  }
  // The last step that can fail.
  const auto began = std::chrono::steady_clock::now();
  source.begin_run(map.view.map_id, session_);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  begin();
  tiles_ = tiles;
  is_session_ = true;
  T_map_base_saved_.reset();
  if (!is_own) {
    // The datum of another map is that in its own file.
    metadata_.erase("datum");
    if (!file_.empty()) remove_if_empty(file_);
    file_ = target;
    store_ = std::move(store);
    lock_ = std::move(target_lock);
  }
  if (is_left_file) follow_to(target, *left_file_);
  if (is_left_file || !is_own) {
    left_file_.reset();
    statistics_.set_map_displaced({});
  }
  statistics_.map_saved(took.count());
  is_memory_alone_ = false;
  left_maps_.forget(target);
  statistics_.set_maps_left(left_maps_.in_words());
  remember_metadata(map);
  remember_as_saved(*latest_map_.view(), latest_map_.poses_added());
  is_partial_ = false;
  return target;
}

NewMap MapSaver::begin_anew(bool discard, const BeginMap& begin) {
  const std::scoped_lock lock(mutex_);
  NewMap begun{.map_id = new_map_id(), .kept_file = {}};
  std::shared_ptr<MovableTileStore> tiles;
  look_after_file_first();
  if (!discard) refuse_to_lose();
  if (!file_.empty()) {
    if (!discard && !is_empty() && !is_saved_whole()) save(CheckpointScope::changed);
    if (open_store().holds_map()) {
      std::error_code unknown;
      const std::uintmax_t bytes = fs::file_size(file_, unknown);
      if (!discard) folder_.check_room(file_, {}, unknown ? 0 : bytes);
      begun.kept_file = folder_.unused_file_for(file_);
      tiles = put_aside(begun.kept_file);
    } else {
      tiles = tiles_of(open_store());
    }
  } else if (memory_limit_bytes_ > 0) {
    auto scratch = open_scratch_map();
    tiles = tiles_of(*scratch);
    store_ = std::move(scratch);
  }
  // Nothing from here on can fail.
  begin(begun.map_id, tiles);
  tiles_ = tiles;
  is_session_ = false;
  saved_map_id_ = 0;
  is_memory_alone_ = false;
  // What lies there was never this map's.
  is_left_file_loaded_ = false;
  stored_metadata_.clear();
  if (discard && !begun.kept_file.empty()) {
    std::error_code not_removed;
    if (fs::remove(begun.kept_file, not_removed)) begun.kept_file.clear();
  }
  return begun;
}

std::shared_ptr<MovableTileStore> MapSaver::put_aside(const fs::path& kept) {
  open_store().complete_file();
  std::optional<FreshMapFile> fresh;
  try {
    fresh.emplace(file_);
    static_cast<void>(open_map_file(fresh->path()));
    // Tiles of the old map may still be read through connections that are open: they keep its
    // file and its log, which is empty, whatever their names are.
    store_.reset();
    fs::rename(file_, kept);
  } catch (const fs::filesystem_error& error) {
    throw MapFileError(file_, std::string("cannot be kept as ") + kept.string() + " (" +
                                  error.what() + "); its folder must be writable");
  }
  try {
    replace_map_file(fresh->path(), file_);
    is_session_ = false;
    return tiles_of(open_store());
  } catch (const MapFileError&) {
    misplaced_ = kept;
    try {
      bring_back();
    } catch (const MapFileError&) {
      // The disk lets it be neither of the two now; the next save tries again.
    }
    throw;
  }
}

void MapSaver::bring_back() {
  store_.reset();
  std::string fault;
  const auto move = [&] {
    try {
      replace_map_file(*misplaced_, file_);
      return file_;
    } catch (const MapFileError& error) {
      fault = error.what();
      return *misplaced_;
    }
  };
  if (tiles_) {
    tiles_->move_file(move);
  } else {
    static_cast<void>(move());
  }
  if (!fault.empty()) {
    throw MapFileError(file_, "is not the running map since a reset failed; that lies in " +
                                  misplaced_->string() + " until it can be moved back (" + fault +
                                  ")");
  }
  misplaced_.reset();
}

RunCheckpoint MapSaver::take(CheckpointScope scope) const {
  RunCheckpoint checkpoint = source_->checkpoint(scope);
  // What is configured, then what the run found out, then what the file had.
  auto metadata = metadata_;
  metadata.merge(checkpoint.map.metadata);
  checkpoint.map.metadata = std::move(metadata);
  checkpoint.map.metadata.insert(stored_metadata_.begin(), stored_metadata_.end());
  std::erase_if(checkpoint.map.metadata, [](const auto& entry) { return entry.second.empty(); });
  return checkpoint;
}

}  // namespace stillmap::server
