#include "server/map_saver.hpp"

#include <stdexcept>
#include <utility>

namespace stillmap {

MapSaver::MapSaver(const MapBoard& board, std::filesystem::path file,
                   std::map<std::string, std::string> metadata)
    : board_(board), file_(std::move(file)), metadata_(std::move(metadata)) {
  // Opened at once: a file that cannot be used is found before the drive, not after it.
  if (!file_.empty()) store_ = open_map_file(file_);
}

std::optional<StoredMap> MapSaver::load() {
  const std::scoped_lock lock(mutex_);
  if (!store_) return std::nullopt;
  return store_->load();
}

void MapSaver::save_if_changed() {
  const std::scoped_lock lock(mutex_);
  if (!store_) return;
  const std::uint64_t poses = board_.poses_added();
  // Nothing mapped yet: an empty map must not replace what the file holds.
  if (poses == 0) return;
  StoredMap map = stored_map();
  if (map.view.map_id == saved_map_id_ && map.view.version == saved_version_ &&
      poses == saved_poses_) {
    return;
  }
  store_->save(map);
  saved_map_id_ = map.view.map_id;
  saved_version_ = map.view.version;
  saved_poses_ = poses;
}

std::filesystem::path MapSaver::save_as(const std::string& name) {
  if (file_.empty() && name.empty()) {
    throw std::invalid_argument(
        "no map file is configured; set map.file in the server's configuration or --map-file");
  }
  const std::filesystem::path plain(name);
  // Requests come over the network: they must not choose any file of this machine.
  if (plain.has_parent_path() || name == "." || name == "..") {
    throw std::invalid_argument("file '" + name +
                                "' must be a plain name; it is put beside the configured map file");
  }
  if (name.empty() || plain == file_.filename()) {
    const std::scoped_lock lock(mutex_);
    store_->save(stored_map());
    return std::filesystem::absolute(file_);
  }
  const std::filesystem::path target = file_.parent_path() / plain;
  const std::scoped_lock lock(mutex_);
  open_map_file(target)->save(stored_map());
  return std::filesystem::absolute(target);
}

StoredMap MapSaver::stored_map() const {
  return {.view = *board_.view(), .trajectory = board_.trajectory(), .metadata = metadata_};
}

}  // namespace stillmap
