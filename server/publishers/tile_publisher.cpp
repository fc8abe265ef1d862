#include "server/publishers/tile_publisher.hpp"

#include <algorithm>

#include "core/map/tile_shelf.hpp"
#include "idl/conversions/tile.hpp"

namespace stillmap {

TilePublisher::TilePublisher(Participant& participant, const Topics& topics)
    : tiles_(participant, topics.tiles.dds_name, topics.tiles.writer),
      index_(participant, topics.tile_index.dds_name, topics.tile_index.writer) {}

void TilePublisher::publish(const std::shared_ptr<const MapView>& shown) {
  // A view of the same version may have tiles in other places: in memory, or away.
  if (shown == last_view_) return;
  last_view_ = shown;
  const MapView& view = *shown;
  const bool same_map = view.map_id == map_id_;
  const MapIdentity identity = wire::identity_of(view);
  take_back_missing(view, identity);
  for (const auto& tile : view.tiles) {
    const auto known = published_.find(tile->info.id);
    const bool is_known =
        same_map && known != published_.end() && known->second.revision == tile->info.revision;
    const bool has_voxels = is_known && known->second.has_voxels;
    if (!is_known || (!has_voxels && !is_away(*tile))) publish_tile(*tile, identity);
    if (has_voxels && is_away(*tile)) forget_voxels(*tile, identity);
  }
  map_id_ = view.map_id;
}

void TilePublisher::publish_tile(const Tile& tile, const MapIdentity& identity) {
  // Keep-last writers always have room.
  if (!is_away(tile)) static_cast<void>(tiles_.write(wire::to_wire(tile, identity)));
  static_cast<void>(index_.write(wire::to_wire(tile.info, identity)));
  published_[tile.info.id] = {tile.info.revision, !is_away(tile)};
}

void TilePublisher::forget_voxels(const Tile& tile, const MapIdentity& identity) {
  // Without its voxels: only the key counts.
  tiles_.forget(wire::to_wire(tile, identity));
  published_[tile.info.id].has_voxels = false;
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
