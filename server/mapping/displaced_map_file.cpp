#include <spdlog/spdlog.h>

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
    case MapFileFate::removed:
      return "was removed while this server has it open";
    case MapFileFate::replaced:
      return "is another file than the one that this server has open";
    default:
      return "was overwritten while this server has it open";
  }
}

}  // namespace

void MapSaver::look_after_file() {
  if (!store_ || file_.empty()) return;
  const MapFileFate fate = store_->fate();
  if (fate == MapFileFate::kept) return;
  const auto began = std::chrono::steady_clock::now();
  const MapFileError displaced(file_, words_of(fate));
  throttled_log_.error("displaced",
                       std::string(displaced.what()) + "; the running map is written anew");
  statistics_.map_save_failed(displaced.what());
  try {
    if (fate == MapFileFate::overwritten) {
      write_anew_from_memory();
    } else {
      write_anew(fate);
    }
  } catch (const MapFileError& error) {
    statistics_.map_save_failed(std::string(displaced.what()) + "; " + error.what());
    throw;
  }
  statistics_.count(counter);
  spdlog::warn("the running map goes on in {}", file_.string());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  // What is in memory alone is still to be saved.
  if (saved_map_id_ != 0) statistics_.map_saved(took.count());
}

bool MapSaver::take_name_again() {
  try {
    if (!lock_->is_held()) lock_ = std::make_unique<MapLock>(file_);
  } catch (const MapFileError&) {
    // Another server's by now.
    return false;
  }
  return store_->copy_to_new(file_);
}

void MapSaver::write_anew(MapFileFate fate) {
  if (fate == MapFileFate::removed && take_name_again()) {
    leave_store_for(file_);
  } else {
    const fs::path target = folder_.unused_file_for(left_file_.value_or(file_));
    auto target_lock = std::make_unique<MapLock>(target);
    if (!store_->copy_to_new(target)) throw MapFileError(target, "was made by somebody just now");
    if (!left_file_) left_file_ = file_;
    leave_store_for(target);
    lock_ = std::move(target_lock);
  }
  static_cast<void>(open_store());
}

void MapSaver::write_anew_from_memory() {
  const fs::path target = folder_.unused_file_for(left_file_.value_or(file_));
  auto target_lock = std::make_unique<MapLock>(target);
  // So that a disk without room is noticed before the store is left.
  static_cast<void>(open_map_file(target));
  if (!left_file_) left_file_ = file_;
  is_session_ = false;
  saved_map_id_ = 0;
  is_memory_alone_ = true;
  leave_store_for(target);
  lock_ = std::move(target_lock);
  static_cast<void>(open_store());
}

void MapSaver::leave_store_for(const fs::path& target) {
  const auto move = [&] {
    const auto remove_log = store_->abandon();
    store_.reset();
    remove_log();
    return target;
  };
  if (tiles_) {
    tiles_->move_file(move);
  } else {
    static_cast<void>(move());
  }
  file_ = target;
}

void MapSaver::leave_out_lost_tiles(SavedMap& map) {
  if (std::exchange(is_memory_alone_, false)) {
    for (const auto& tile : map.view.tiles) {
      if (is_non_resident(*tile)) lost_tiles_.push_back(tile->info.id);
    }
    if (!lost_tiles_.empty()) {
      spdlog::error("{} tiles of the running map were in the overwritten file alone, and are lost",
                    lost_tiles_.size());
    }
  }
  std::vector<TileTable::Edit> edits;
  for (const TileId id : lost_tiles_) {
    // It may have been mapped anew.
    const auto tile = map.view.tiles.find(id);
    if (tile && is_non_resident(*tile)) edits.push_back({id, nullptr});
  }
  if (!edits.empty()) map.view.tiles = map.view.tiles.with(edits);
}

}  // namespace stillmap::server
