#include "server/map_saver.hpp"

#include <stdexcept>
#include <utility>

namespace stillmap {
namespace {

constexpr const char* no_map_yet = "holds no map yet; name a file that a map was saved to";

/// Opens a file that is there: open_map_file would make one that is not.
std::unique_ptr<TileStore> open_filled(const std::filesystem::path& file) {
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

}  // namespace

MapSaver::MapSaver(const MapBoard& board, std::filesystem::path file,
                   std::map<std::string, std::string> metadata)
    : board_(board), file_(std::move(file)), metadata_(std::move(metadata)) {
  // Opened at once: a file that cannot be used is found before the drive, not after it.
  if (!file_.empty()) store_ = open_map_file(file_);
}

std::optional<StoredMap> MapSaver::load() {
  const std::scoped_lock lock(mutex_);
  if (!store_) return std::nullopt;
  StoredMap map = store_->load();
  stored_metadata_ = map.metadata;
  return map;
}

void MapSaver::save_if_changed() {
  const std::scoped_lock lock(mutex_);
  save_current_if_changed();
}

void MapSaver::save_current_if_changed() {
  if (!store_) return;
  const std::uint64_t poses = board_.poses_added();
  // Nothing mapped yet: an empty map must not replace what the file holds.
  if (poses == 0) return;
  const StoredMap map = stored_map();
  if (map.view.map_id == saved_map_id_ && map.view.version == saved_version_ &&
      poses == saved_poses_) {
    return;
  }
  store_->save(map);
  remember_as_saved(map.view, poses);
}

void MapSaver::remember_as_saved(const MapView& view, std::uint64_t poses) {
  saved_map_id_ = view.map_id;
  saved_version_ = view.version;
  saved_poses_ = poses;
}

std::filesystem::path MapSaver::file_named(const std::string& name) const {
  if (file_.empty() && name.empty()) {
    throw std::invalid_argument(
        "no map file is configured; set map.file in the server's configuration or --map-file");
  }
  const std::filesystem::path plain(name);
  // Requests come over the network: they must not choose any file of this machine.
  if (plain.has_parent_path() || name == "." || name == "..") {
    throw std::invalid_argument("file '" + name +
                                "' must be a plain name; it is looked for beside the configured "
                                "map file");
  }
  return name.empty() ? file_ : file_.parent_path() / plain;
}

std::filesystem::path MapSaver::save_as(const std::string& name) {
  const std::scoped_lock lock(mutex_);
  const std::filesystem::path target = file_named(name);
  if (target == file_) {
    store_->save(stored_map());
  } else {
    open_map_file(target)->save(stored_map());
  }
  return std::filesystem::absolute(target);
}

std::filesystem::path MapSaver::go_on_in(const std::string& name,
                                         const std::function<void()>& show_now,
                                         const std::function<void(StoredMap)>& replace_running) {
  const std::scoped_lock lock(mutex_);
  const std::filesystem::path target = file_named(name);
  auto store = open_filled(target);
  StoredMap map = store->load();
  if (map.view.tiles.empty()) throw MapFileError(target, no_map_yet);
  if (target != file_) {
    show_now();
    save_current_if_changed();
  }
  std::map<std::string, std::string> metadata = map.metadata;
  replace_running(std::move(map));
  // Where another map lies, its own file says.
  if (target != file_) metadata_.erase("datum");
  file_ = target;
  store_ = std::move(store);
  stored_metadata_ = std::move(metadata);
  remember_as_saved(*board_.view(), board_.poses_added());
  return std::filesystem::absolute(target);
}

StoredMap MapSaver::stored_map() const {
  StoredMap map{.view = *board_.view(), .trajectory = board_.trajectory(), .metadata = metadata_};
  map.metadata.insert(stored_metadata_.begin(), stored_metadata_.end());
  return map;
}

}  // namespace stillmap
