#include "server/mapping/map_saver.hpp"

#include <algorithm>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace stillmap::server {
namespace {

constexpr const char* no_map_yet = "holds no map yet; name a file that a map was saved to";

/// Opens a file that is there: open_map_file would make one that is not.
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

/// Requests come over the network: they must not choose any file of this machine, nor one of those
/// that SQLite keeps beside the map file while it is open.
bool is_plain_name(const std::string& name) {
  const std::filesystem::path plain(name);
  const auto is_control = [](unsigned char c) { return c < ' '; };
  const auto ends_as = [&](const char* ending) { return name.ends_with(ending); };
  return !plain.has_parent_path() && name != "." && name != ".." &&
         std::ranges::none_of(name, is_control) && !ends_as("-wal") && !ends_as("-shm") &&
         !ends_as("-journal");
}

}  // namespace

MapSaver::MapSaver(const LatestMap& latest_map, std::filesystem::path file,
                   std::map<std::string, std::string> metadata, std::uint32_t memory_limit_mib)
    : latest_map_(latest_map),
      file_(std::move(file)),
      metadata_(std::move(metadata)),
      memory_limit_bytes_(std::size_t{memory_limit_mib} << 20),
      source_{
          .take =
              [this](bool) {
                return RunCheckpoint{{*latest_map_.view(), {}, latest_map_.trajectory(), {}}, 0};
              },
          .stored = [](std::uint64_t) {},
          .map_bytes = [] { return std::size_t{0}; }} {
  // Opened at once: a file that cannot be used is found before the drive, not after it.
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
  // Clients may have seen later versions than the one that is stored: versions of what follows
  // must not be taken for those.
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

void MapSaver::set_source(CheckpointSource source) {
  const std::scoped_lock lock(mutex_);
  source_ = std::move(source);
}

void MapSaver::save_if_changed() {
  const std::scoped_lock lock(mutex_);
  if (!store_ || is_saved()) return;
  // A file for the run only serves to make room.
  if (file_.empty() && source_.map_bytes() < memory_limit_bytes_ / 2) return;
  save(false);
}

void MapSaver::save_at_end() {
  const std::scoped_lock lock(mutex_);
  // Nothing mapped: an empty map must not replace what the file holds.
  if (!file_.empty() && latest_map_.poses_added() > 0) save(true);
}

bool MapSaver::is_saved() const {
  const auto view = latest_map_.view();
  const std::uint64_t poses = latest_map_.poses_added();
  return poses == 0 || (view->map_id == saved_map_id_ && view->version == saved_version_ &&
                        poses == saved_poses_);
}

void MapSaver::save(bool has_ended) {
  CheckpointLog::Attempt attempt(checkpoints_);
  const std::uint64_t poses = latest_map_.poses_added();
  RunCheckpoint checkpoint = take(false);
  // Of another map than the stored one, all is new.
  if (checkpoint.map.view.map_id != saved_map_id_) checkpoint = take(true);
  if (has_ended) checkpoint.map.metadata[map_ended_key] = "yes";
  store_->save(checkpoint.map);
  source_.stored(checkpoint.step);
  remember_as_saved(checkpoint.map.view, poses);
  attempt.stored();
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
  if (store_) save(false);
  if (store_ && target != file_) store_->copy_to(target);
  if (!store_) open_map_file(target)->save(take(true).map);
  return std::filesystem::absolute(target);
}

std::filesystem::path MapSaver::resume_from(const std::string& name,
                                            const ReplaceRunning& replace_running) {
  const std::scoped_lock lock(mutex_);
  const std::filesystem::path target = file_named(name);
  auto store = open_existing(target);
  SavedMap map = read(*store);
  if (map.view.tiles.empty()) throw MapFileError(target, no_map_yet);
  if (target != file_ && !file_.empty() && latest_map_.poses_added() > 0) save(false);
  map.view.map_id = new_map_id();
  replace_running(map, memory_limit_bytes_ > 0 ? store->tile_store() : nullptr);
  store->begin_run(map.view.map_id);
  // Where another map lies, its own file says.
  if (target != file_) metadata_.erase("datum");
  file_ = target;
  store_ = std::move(store);
  remember_metadata(map);
  remember_as_saved(*latest_map_.view(), latest_map_.poses_added());
  return std::filesystem::absolute(target);
}

RunCheckpoint MapSaver::take(bool everything) const {
  RunCheckpoint checkpoint = source_.take(everything);
  checkpoint.map.metadata = metadata_;
  checkpoint.map.metadata.insert(stored_metadata_.begin(), stored_metadata_.end());
  return checkpoint;
}

}  // namespace stillmap::server
