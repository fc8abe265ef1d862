#include "server/mapping/map_saver.hpp"

#include <algorithm>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace stillmap::server {
namespace {

/// Saves whose durations decide when the next one is due.
constexpr std::size_t recent_saves = 10;
/// The next save may take so many times the longest of them.
constexpr double duration_margin = 1.5;

/// A robot that has gone no farther stands [m], [rad].
constexpr double standing_distance_m = 0.5;
constexpr double standing_angle_rad = 0.2;

constexpr const char* no_map_yet = "holds no map yet; name a file that a map was saved to";

/// Opens an existing file; open_map_file would create a missing one.
std::unique_ptr<MapStore> open_existing(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    throw MapFileError(file, "is not there; it must lie beside the configured map file");
  }
  if (std::filesystem::is_regular_file(file, error) &&
      std::filesystem::file_size(file, error) == 0) {
    throw MapFileError(file, no_map_yet);
  }
  return open_map_file(file);
}

/// Requests come over the network: they must not name any file outside the map folder, nor those
/// that SQLite keeps beside an open map file.
bool is_plain_name(const std::string& name) {
  const std::filesystem::path plain(name);
  const auto is_control = [](unsigned char c) { return c < ' '; };
  const auto ends_as = [&](const char* ending) { return name.ends_with(ending); };
  return !plain.has_parent_path() && name != "." && name != ".." &&
         std::ranges::none_of(name, is_control) && !ends_as("-wal") && !ends_as("-shm") &&
         !ends_as("-journal");
}

}  // namespace

MapSaver::MapSaver(const LatestMap& latest_map, Statistics& statistics, std::filesystem::path file,
                   std::map<std::string, std::string> metadata, const MapSaverLimits& limits,
                   MonotonicClock& clock)
    : latest_map_(latest_map),
      statistics_(statistics),
      file_(std::move(file)),
      metadata_(std::move(metadata)),
      memory_limit_bytes_(std::size_t{limits.memory_limit_mib} << 20),
      standing_allowance_(std::uint64_t{limits.standing_mib_per_hour} << 20),
      clock_(clock) {
  // Opened at the start, so that a file that cannot be written is noticed before mapping begins.
  if (!file_.empty()) {
    store_ = open_map_file(file_);
  } else if (memory_limit_bytes_ > 0) {
    store_ = open_scratch_map();
  }
}

std::optional<SavedMap> MapSaver::load() {
  const std::scoped_lock lock(mutex_);
  if (file_.empty()) return std::nullopt;
  SavedMap map = read(*store_);
  // Clients may have seen later versions than the stored one; under a new id, the versions that
  // follow cannot be confused with those.
  if (!map.metadata.contains(map_ended_key)) map.view.map_id = new_map_id();
  store_->begin_run(map.view.map_id);
  saved_map_id_ = map.view.map_id;
  remember_metadata(map);
  return map;
}

SavedMap MapSaver::read(MapStore& store) const {
  return memory_limit_bytes_ > 0 ? store.load_non_resident() : store.load();
}

std::shared_ptr<TileStore> MapSaver::tile_store() {
  return memory_limit_bytes_ > 0 ? store_->tile_store() : nullptr;
}

void MapSaver::set_source(CheckpointSource& source) {
  const std::scoped_lock lock(mutex_);
  source_ = &source;
}

void MapSaver::save_if_changed() {
  const std::scoped_lock lock(mutex_);
  if (!store_ || is_saved()) return;
  // A temporary file is only there to make room in memory.
  if (file_.empty() && source_->memory_use().bytes < memory_limit_bytes_ / 2) return;
  save(scope());
}

void MapSaver::save_at_end() {
  const std::scoped_lock lock(mutex_);
  // Nothing mapped: an empty map must not replace what the file holds.
  if (!file_.empty() && latest_map_.poses_added() > 0) save(CheckpointScope::changed, true);
}

void MapSaver::make_room() {
  const std::scoped_lock lock(mutex_);
  if (store_) save(CheckpointScope::changed);
}

CheckpointScope MapSaver::scope() {
  // Evidence that is not stored cannot be evicted.
  const bool is_full =
      memory_limit_bytes_ > 0 && source_->memory_use().bytes > memory_limit_bytes_ / 2;
  if (is_full || has_moved() || standing_allowance_.is_open(clock_.now())) {
    return CheckpointScope::changed;
  }
  return CheckpointScope::changed_views;
}

bool MapSaver::has_moved() const {
  if (!T_map_base_saved_ || latest_map_.view()->map_id != saved_map_id_) return true;
  const Eigen::Isometry3d motion =
      T_map_base_saved_->inverse() * latest_map_.newest_pose().T_map_lidar;
  return motion.translation().norm() > standing_distance_m ||
         Eigen::AngleAxisd(motion.linear()).angle() > standing_angle_rad;
}

bool MapSaver::is_saved() const {
  const auto view = latest_map_.view();
  const std::uint64_t poses = latest_map_.poses_added();
  return poses == 0 || (view->map_id == saved_map_id_ && view->version == saved_version_ &&
                        poses == saved_poses_);
}

void MapSaver::save(CheckpointScope scope, bool has_ended) {
  const auto began = std::chrono::steady_clock::now();
  try {
    if (!store(scope, has_ended)) return;
  } catch (...) {
    statistics_.map_save_failed();
    throw;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  statistics_.map_saved(took.count());
}

bool MapSaver::store(CheckpointScope scope, bool has_ended) {
  const std::uint64_t poses = latest_map_.poses_added();
  const bool is_standing = !has_moved();
  const Eigen::Isometry3d T_map_base = latest_map_.newest_pose().T_map_lidar;
  RunCheckpoint checkpoint = take(scope);
  // Nothing is stored yet of another map.
  if (checkpoint.map.view.map_id != saved_map_id_) {
    scope = CheckpointScope::everything;
    checkpoint = take(scope);
  }
  checkpoint.map.is_partial = scope == CheckpointScope::changed_views;
  if (checkpoint.map.is_partial && checkpoint.map.tile_evidence.empty()) return false;
  if (has_ended) checkpoint.map.metadata[map_ended_key] = "yes";
  const std::uint64_t bytes = store_->save(checkpoint.map);
  source_->checkpoint_stored(checkpoint.step);
  remember_as_saved(checkpoint.map.view, poses);
  if (is_standing) standing_allowance_.spend(bytes);
  if (!checkpoint.map.is_partial) T_map_base_saved_ = T_map_base;
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

std::filesystem::path MapSaver::file_named(const std::string& name) const {
  if (file_.empty() && name.empty()) {
    throw std::invalid_argument(
        "no map file is configured; set map.file in the server's configuration or --map-file");
  }
  if (!is_plain_name(name)) {
    throw std::invalid_argument("file '" + name +
                                "' must be a plain name; it is looked for beside the configured "
                                "map file");
  }
  return name.empty() ? file_ : file_.parent_path() / name;
}

std::filesystem::path MapSaver::save_as(const std::string& name) {
  const std::scoped_lock lock(mutex_);
  const std::filesystem::path target = file_named(name);
  if (store_) save(CheckpointScope::changed);
  if (store_ && target != file_) store_->copy_to(target);
  if (!store_) open_map_file(target)->save(take(CheckpointScope::everything).map);
  return std::filesystem::absolute(target);
}

std::filesystem::path MapSaver::resume_from(const std::string& name,
                                            const ReplaceRunning& replace_running) {
  const std::scoped_lock lock(mutex_);
  const std::filesystem::path target = file_named(name);
  auto store = open_existing(target);
  SavedMap map = read(*store);
  if (map.view.tiles.empty()) throw MapFileError(target, no_map_yet);
  if (target != file_ && !file_.empty() && latest_map_.poses_added() > 0) {
    save(CheckpointScope::changed);
  }
  map.view.map_id = new_map_id();
  replace_running(map, memory_limit_bytes_ > 0 ? store->tile_store() : nullptr);
  store->begin_run(map.view.map_id);
  // The datum of another map is that in its own file.
  if (target != file_) metadata_.erase("datum");
  file_ = target;
  store_ = std::move(store);
  T_map_base_saved_.reset();
  remember_metadata(map);
  remember_as_saved(*latest_map_.view(), latest_map_.poses_added());
  return std::filesystem::absolute(target);
}

RunCheckpoint MapSaver::take(CheckpointScope scope) const {
  RunCheckpoint checkpoint = source_->checkpoint(scope);
  checkpoint.map.metadata = metadata_;
  checkpoint.map.metadata.insert(stored_metadata_.begin(), stored_metadata_.end());
  return checkpoint;
}

bool WriteAllowance::is_open(MonotonicClock::TimePoint now) {
  if (bytes_per_hour_ == 0.0) return true;
  if (refilled_) {
    const std::chrono::duration<double, std::ratio<3600>> hours = now - *refilled_;
    left_ = std::min(bytes_per_hour_, left_ + hours.count() * bytes_per_hour_);
  }
  refilled_ = now;
  return left_ > 0.0;
}

std::chrono::duration<double> due_after_begin(std::chrono::duration<double> period,
                                              std::chrono::duration<double> longest) {
  return std::max(period - duration_margin * longest, 0.5 * period);
}

CheckpointWorker::CheckpointWorker(std::chrono::duration<double> period, std::function<void()> save,
                                   MonotonicClock& clock)
    : period_(period),
      save_(std::move(save)),
      clock_(clock),
      worker_([this](const std::stop_token&) { return save_and_schedule(); }, clock) {}

MonotonicClock::TimePoint CheckpointWorker::save_and_schedule() {
  const auto began = clock_.now();
  try {
    save_();
  } catch (const MapFileError& error) {
    throttled_log_.error("save", std::string("the map was not saved: ") + error.what());
  }
  durations_.emplace_back(clock_.now() - began);
  if (durations_.size() > recent_saves) durations_.pop_front();
  const auto due = due_after_begin(period_, *std::ranges::max_element(durations_));
  return began + std::chrono::duration_cast<std::chrono::steady_clock::duration>(due);
}

}  // namespace stillmap::server
