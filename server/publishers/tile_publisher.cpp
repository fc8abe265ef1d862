#include "server/publishers/tile_publisher.hpp"

#include <algorithm>

#include "idl/conversions/tile.hpp"

namespace stillmap {

TilePublisher::TilePublisher(Participant& participant, const Topics& topics)
    : tiles_(participant, topics.tiles.dds_name, topics.tiles.writer),
      index_(participant, topics.tile_index.dds_name, topics.tile_index.writer) {}

void TilePublisher::publish(const MapView& view) {
  const bool same_map = view.map_id == map_id_;
  if (same_map && view.version == version_) return;
  const MapIdentity identity = wire::identity_of(view);
  take_back_missing(view, identity);
  for (const auto& tile : view.tiles) {
    const auto known = published_.find(tile->info.id);
    const bool current =
        same_map && known != published_.end() && known->second == tile->info.revision;
    if (!current) publish_tile(*tile, identity);
  }
  map_id_ = view.map_id;
  version_ = view.version;
}

void TilePublisher::publish_tile(const Tile& tile, const MapIdentity& identity) {
  // Keep-last writers always have room.
  static_cast<void>(tiles_.write(wire::to_wire(tile, identity)));
  static_cast<void>(index_.write(wire::to_wire(tile.info, identity)));
  published_[tile.info.id] = tile.info.revision;
}

void TilePublisher::take_back_missing(const MapView& view, const MapIdentity& identity) {
  const auto is_gone = [&](const auto& entry) {
    const auto found = std::ranges::lower_bound(view.tiles, entry.first, {},
                                                [](const auto& tile) { return tile->info.id; });
    return found == view.tiles.end() || (*found)->info.id != entry.first;
  };
  std::erase_if(published_, [&](const auto& entry) {
    if (!is_gone(entry)) return false;
    Tile gone;
    gone.info = {.id = entry.first, .revision = view.version, .bounds_map = {}};
    tiles_.dispose(wire::to_wire(gone, identity));
    // Disposed samples do not pass content filters: the index says it with an empty tile.
    static_cast<void>(index_.write(wire::to_wire(gone.info, identity)));
    return true;
  });
}

}  // namespace stillmap
