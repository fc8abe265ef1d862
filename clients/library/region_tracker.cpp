#include "clients/library/region_tracker.hpp"

#include <utility>

#include "core/map/voxel_grid.hpp"

namespace stillmap {

void RegionTracker::add_index_entry(const dds::MapIdentity& map, const TileInfo& info) {
  if (!region_.may_intersect(tile_footprint(info.id, tile_size_m_))) return;
  if (map.map_id != map_.map_id) clear();
  map_ = map;
  if (info.voxel_count == 0) {
    remove(info.id);
  } else {
    pending_.insert(info.id);
  }
}

void RegionTracker::clear() {
  removed_.merge(known_);
  known_.clear();
  pending_.clear();
}

void RegionTracker::remove(TileId id) {
  pending_.erase(id);
  if (known_.erase(id) > 0) removed_.insert(id);
}

RegionUpdate RegionTracker::take_update(TileSet fetched) {
  RegionUpdate update{.map = map_, .appeared = {}, .changed = {}, .removed = {}};
  if (fetched.map.map_id == map_.map_id) {
    for (const TileId id : fetched.missing) remove(id);
    for (Tile& tile : fetched.tiles) {
      pending_.erase(tile.info.id);
      const bool is_replaced = removed_.erase(tile.info.id) > 0;
      const bool is_known = !known_.insert(tile.info.id).second || is_replaced;
      (is_known ? update.changed : update.appeared).push_back(std::move(tile));
    }
  }
  update.removed.assign(removed_.begin(), removed_.end());
  removed_.clear();
  return update;
}

}  // namespace stillmap
