#include "clients/library/tile_mirror.hpp"

#include <algorithm>

namespace stillmap {

TileMirror::TileMirror() : snapshot_(std::make_shared<const MapSnapshot>()) {}

void TileMirror::apply(const RegionUpdate& update) {
  {
    const std::lock_guard lock(mutex_);
    if (update.map.map_id != snapshot_->map_id) tiles_.clear();
    for (const TileId id : update.removed) tiles_.erase(id);
    for (const std::vector<Tile>* arrived : {&update.appeared, &update.changed}) {
      for (const Tile& tile : *arrived) {
        std::shared_ptr<const Tile>& held = tiles_[tile.info.id];
        if (held && held->info.revision >= tile.info.revision) continue;
        held = std::make_shared<const Tile>(tile);
      }
    }
    snapshot_ = make_snapshot(update.map);
  }
  changed_.notify_all();
}

std::shared_ptr<const MapSnapshot> TileMirror::make_snapshot(const dds::MapIdentity& map) const {
  auto view = std::make_shared<MapSnapshot>();
  view->map_id = map.map_id;
  view->tile_size_m = map.tile_size_m;
  view->voxel_size_m = map.voxel_size_m;
  view->version = map.version;
  // A fetched tile may be newer than the update.
  std::vector<std::shared_ptr<const Tile>> tiles;
  tiles.reserve(tiles_.size());
  for (const auto& [id, tile] : tiles_) {
    view->version = std::max(view->version, tile->info.revision);
    tiles.push_back(tile);
  }
  view->tiles = TileTable(std::move(tiles));
  return view;
}

std::shared_ptr<const MapSnapshot> TileMirror::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

std::shared_ptr<const MapSnapshot> TileMirror::wait_for_change(
    const std::shared_ptr<const MapSnapshot>& known, std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return snapshot_ != known; });
  return snapshot_;
}

std::vector<TileId> TileMirror::lacks(const TileVersions& versions) const {
  const std::lock_guard lock(mutex_);
  const bool is_of_map = versions.map.map_id == snapshot_->map_id;
  std::vector<TileId> lacking;
  for (const TileInfo& info : versions.tiles) {
    const auto held = tiles_.find(info.id);
    if (!is_of_map || held == tiles_.end() || held->second->info.revision < info.revision)
      lacking.push_back(info.id);
  }
  return lacking;
}

std::vector<TileId> wait_for_whole_map(Client& client, const TileMirror& mirror,
                                       std::chrono::milliseconds timeout) {
  // Repeated, since tiles of an older answer may have been removed meanwhile.
  constexpr std::chrono::milliseconds recheck_period(1000);
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (std::chrono::steady_clock::now() < deadline) {
    const TileVersions versions = client.get_tile_versions();
    const auto until = std::chrono::steady_clock::now() + recheck_period;
    while (std::chrono::steady_clock::now() < until) {
      const auto seen = mirror.snapshot();
      if (mirror.holds(versions)) return {};
      (void)mirror.wait_for_change(seen, std::chrono::milliseconds(50));
    }
    // Few are not only late.
    constexpr std::size_t max_unreadable = 100;
    const std::vector<TileId> lacking = mirror.lacks(versions);
    if (lacking.empty() || lacking.size() > max_unreadable) continue;
    if (std::vector<TileId> unreadable = client.get_tiles(lacking).unreadable;
        unreadable.size() == lacking.size())
      return unreadable;
  }
  throw ServiceTimeout(
      "the server's map did not arrive: " + std::to_string(mirror.snapshot()->tiles.size()) +
      " tiles of it within " + std::to_string(timeout.count()) +
      " ms; allow more with --timeout, or look at the network's load");
}

}  // namespace stillmap
