#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>

#include "server/mapping/map_saver.hpp"

// What a saver does when somebody removed its map file, or put another one in its place: the
// running map is written anew, and what lies there now is left as it is.

namespace stillmap::server {
namespace {

namespace fs = std::filesystem;

constexpr const char* counter = "map_files_displaced";

std::string words_of(MapFileFate fate) {
  switch (fate) {
    case MapFileFate::kept:
      return "is written to by another process, since its lock was removed";
    case MapFileFate::removed:
      return "was removed while this server has it open";
    case MapFileFate::replaced:
      return "is another file than the one that this server has open";
    default:
      return "was overwritten while this server has it open";
  }
}

}  // namespace

void MapSaver::count_failure(const std::exception& error) {
  statistics_.map_save_failed(error.what());
  try {
    // What is in memory of it is nowhere else, and must not be evicted.
    if (store_ && !file_.empty() && store_->fate() == MapFileFate::overwritten)
      source_->stored_is_gone();
  } catch (const MapFileError&) {
    // That it cannot be looked at says nothing of what it holds.
    throttled_log_.error("unseen", "the map file cannot be looked at");
  }
  // Where the map fills its memory, it is frozen.
  source_->checkpoint_failed();
}

void MapSaver::look_after_file_first() {
  try {
    look_after_file();
  } catch (const std::exception& error) {
    count_failure(error);
    throw;
  }
}

void MapSaver::look_after_file() {
  if (!store_ || file_.empty()) return;
  tell_of_left_maps();
  const MapFileFate fate = store_->fate();
  if (fate == MapFileFate::kept && keep_lock()) return tell_where_name_leads();
  if (fate == MapFileFate::replaced && follow_name()) return;
  const auto began = std::chrono::steady_clock::now();
  const MapFileError displaced(file_, words_of(fate));
  throttled_log_.error("displaced",
                       std::string(displaced.what()) + "; the running map is written anew");
  try {
    if (fate == MapFileFate::overwritten) {
      write_anew_from_memory();
    } else if (!write_anew(fate)) {
      return;
    }
  } catch (const std::exception& error) {
    throw MapFileError(file_, words_of(fate) + "; " + error.what());
  }
  statistics_.map_save_failed(displaced.what());
  statistics_.count(counter);
  spdlog::warn("the running map goes on in {}", file_.string());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  // What is in memory alone is still to be saved.
  if (saved_map_id_ != 0 || is_empty()) statistics_.map_saved(took.count());
}

bool MapSaver::keep_lock() {
  if (lock_->is_held()) return true;
  try {
    lock_ = std::make_unique<MapLock>(file_);
    spdlog::warn("the lock of {} was removed, and is there again", file_.string());
  } catch (const MapFileInUseError&) {
    return false;
  } catch (const MapFileError& error) {
    throttled_log_.error("lock",
                         std::string(error.what()) +
                             "; its lock was removed, and another server may be started on it");
  }
  return true;
}

void MapSaver::tell_of_left_maps() {
  if (!left_maps_.empty()) statistics_.set_maps_left(left_maps_.in_words());
}

void MapSaver::tell_where_name_leads() {
  if (left_file_ || file_ != configured_file_) return;
  std::string elsewhere;
  try {
    const fs::path there = real_file(configured_name_);
    if (there != file_) elsewhere = "leads to " + there.string();
  } catch (const MapFileError& error) {
    elsewhere = std::string("leads nowhere (") + error.what() + ")";
  }
  if (!elsewhere.empty()) {
    elsewhere = configured_name_.string() + " " + elsewhere +
                " by now; the running map is saved to " + file_.string() +
                ", and the next start does not resume it";
  }
  statistics_.set_map_displaced(elsewhere);
}

void MapSaver::move_to(const fs::path& target, std::unique_ptr<MapLock> target_lock) {
  const fs::path name = file_;
  leave_store_for(target);
  follow_to(target, name);
  if (target_lock) lock_ = std::move(target_lock);
}

void MapSaver::follow_to(const fs::path& target, const fs::path& name) {
  // Where a reset can rename it.
  folder_ = folder_.of(target);
  if (name == configured_file_) configured_file_ = target;
}

bool MapSaver::follow_name() {
  if (!store_->is_same_under_name()) return false;
  const fs::path target = real_file(file_);
  std::unique_ptr<MapLock> target_lock;
  try {
    if (target != file_) target_lock = std::make_unique<MapLock>(target);
    // Before the store is left.
    if (::access(target.c_str(), W_OK) != 0) throw MapFileError(target, "cannot be written");
  } catch (const MapFileError& error) {
    throttled_log_.error("lock", error.what());
    return false;
  }
  if (target != file_) spdlog::warn("{} leads to {} by now", file_.string(), target.string());
  move_to(target, std::move(target_lock));
  static_cast<void>(open_store());
  return true;
}

bool MapSaver::take_name_again() {
  try {
    // A link may have the name, also one to another disk.
    const fs::path target = real_file(file_);
    std::unique_ptr<MapLock> target_lock;
    if (target != file_ || !lock_->is_held()) target_lock = std::make_unique<MapLock>(target);
    if (!store_->copy_to_new(target)) return false;
    move_to(target, std::move(target_lock));
    return true;
  } catch (const MapFileError& error) {
    // Another server's by now, or where it leads to cannot be written.
    throttled_log_.error("name", error.what());
    return false;
  }
}

bool MapSaver::write_anew(MapFileFate fate) {
  if (fate != MapFileFate::removed || !take_name_again()) {
    // It may have been away for a moment.
    if (fate != MapFileFate::kept && store_->fate() == MapFileFate::kept) return false;
    const fs::path target = name_beside();
    auto target_lock = std::make_unique<MapLock>(target);
    if (!store_->copy_to_new(target)) throw MapFileError(target, "was made by somebody just now");
    leave_name();
    leave_store_for(target, is_locked_by_another());
    lock_ = std::move(target_lock);
  }
  static_cast<void>(open_store());
  return true;
}

fs::path MapSaver::name_beside() const {
  const fs::path target = folder_.unused_file_for(left_file_.value_or(file_));
  std::error_code unknown;
  const std::uintmax_t bytes = fs::file_size(file_, unknown);
  if (!has_ended_) folder_.check_room(file_, {}, unknown ? 0 : bytes);
  return target;
}

void MapSaver::leave_name() {
  if (!left_file_) left_file_ = file_;
  is_left_file_loaded_ = true;
}

void MapSaver::remove_if_empty(const fs::path& made_beside) {
  try {
    if (!left_file_ || !store_ || store_->fate() != MapFileFate::kept || store_->holds_map())
      return;
  } catch (const MapFileError&) {
    // It may hold something.
    return;
  }
  std::error_code ignored;
  // SQLite leaves its files beside one that is gone.
  for (const char* suffix : {"", "-wal", "-shm"})
    fs::remove(made_beside.string() + suffix, ignored);
}

void MapSaver::write_anew_from_memory() {
  const fs::path target = name_beside();
  auto target_lock = std::make_unique<MapLock>(target);
  // So that a disk without room is noticed before the store is left.
  static_cast<void>(open_map_file(target));
  leave_name();
  is_session_ = false;
  saved_map_id_ = 0;
  is_memory_alone_ = true;
  leave_store_for(target, is_locked_by_another());
  lock_ = std::move(target_lock);
  static_cast<void>(open_store());
}

bool MapSaver::is_locked_by_another() const {
  std::error_code unknown;
  return !lock_->is_held() && fs::exists(file_.string() + ".lock", unknown);
}

void MapSaver::leave_store_for(const fs::path& target, bool is_log_of_another) {
  const auto move = [&] {
    const auto remove_log = store_->abandon();
    store_.reset();
    if (!is_log_of_another) remove_log();
    return target;
  };
  if (tiles_) {
    tiles_->move_file(move);
  } else {
    static_cast<void>(move());
  }
  file_ = target;
  if (!left_file_) return;
  statistics_.set_map_displaced(left_file_->string() +
                                " is not the running map's file any more; that is saved to " +
                                file_.string() + " until another map is loaded");
}

void MapSaver::leave_out_lost_tiles(SavedMap& map) {
  if (!std::exchange(is_memory_alone_, false)) return;
  std::vector<TileTable::Edit> lost;
  for (const auto& tile : map.view.tiles) {
    if (is_non_resident(*tile)) lost.push_back({tile->info.id, nullptr});
  }
  if (!lost.empty()) {
    spdlog::error("{} tiles of the running map were in the overwritten file alone, and are lost",
                  lost.size());
    map.view.tiles = map.view.tiles.with(lost);
  }
  // Later checkpoints have none of them any more.
  source_->forget_lost_tiles();
}

}  // namespace stillmap::server
