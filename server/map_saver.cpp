#include "server/map_saver.hpp"

#include <stdexcept>
#include <utility>

namespace stillmap {

MapSaver::MapSaver(const MapBoard& board, std::filesystem::path file,
                   std::map<std::string, std::string> metadata, std::uint32_t memory_limit_mib)
    : board_(board),
      file_(std::move(file)),
      metadata_(std::move(metadata)),
      memory_limit_bytes_(std::size_t{memory_limit_mib} << 20),
      source_{.take =
                  [this](bool) {
                    return RunCheckpoint{{*board_.view(), {}, board_.trajectory(), {}}, 0};
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

std::optional<StoredMap> MapSaver::load() {
  const std::scoped_lock lock(mutex_);
  if (file_.empty()) return std::nullopt;
  StoredMap map = memory_limit_bytes_ > 0 ? store_->load_shelved() : store_->load();
  // Clients may have seen later versions than the one that is stored: versions of what follows
  // must not be taken for those.
  if (!map.metadata.contains(map_ended_key)) map.view.map_id = new_map_id();
  store_->begin_run(map.view.map_id);
  saved_map_id_ = map.view.map_id;
  return map;
}

std::shared_ptr<TileShelf> MapSaver::shelf() {
  return memory_limit_bytes_ > 0 ? store_->shelf() : nullptr;
}

void MapSaver::follow(CheckpointSource source) {
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
  if (!file_.empty() && board_.poses_added() > 0) save(true);
}

bool MapSaver::is_saved() const {
  const auto view = board_.view();
  const std::uint64_t poses = board_.poses_added();
  return poses == 0 || (view->map_id == saved_map_id_ && view->version == saved_version_ &&
                        poses == saved_poses_);
}

void MapSaver::save(bool has_ended) {
  const std::uint64_t poses = board_.poses_added();
  RunCheckpoint checkpoint = take(false);
  // Of another map than the stored one, all is new.
  if (checkpoint.map.view.map_id != saved_map_id_) checkpoint = take(true);
  if (has_ended) checkpoint.map.metadata[map_ended_key] = "yes";
  store_->save(checkpoint.map);
  source_.stored(checkpoint.step);
  saved_map_id_ = checkpoint.map.view.map_id;
  saved_version_ = checkpoint.map.view.version;
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
  const std::scoped_lock lock(mutex_);
  if (store_) save(false);
  if (name.empty() || plain == file_.filename()) return std::filesystem::absolute(file_);
  const std::filesystem::path target = file_.parent_path() / plain;
  if (store_) {
    store_->copy_to(target);
  } else {
    open_map_file(target)->save(take(true).map);
  }
  return std::filesystem::absolute(target);
}

RunCheckpoint MapSaver::take(bool everything) const {
  RunCheckpoint checkpoint = source_.take(everything);
  checkpoint.map.metadata = metadata_;
  return checkpoint;
}

}  // namespace stillmap
