#include "clients/library/region_tracker.hpp"

#include <utility>

#include "core/map/tile_lookup.hpp"

namespace stillmap {

void RegionWatch::note(const MapIdentity& map, const TileInfo& info) {
  if (!region_.may_meet(tile_footprint(info.id, tile_size_m_))) return;
  if (map.map_id != map_.map_id) forget_all();
  map_ = map;
  if (info.voxel_count == 0) {
    remove(info.id);
  } else {
    wanted_.insert(info.id);
  }
}

void RegionWatch::forget_all() {
  removed_.merge(known_);
  known_.clear();
  wanted_.clear();
}

void RegionWatch::remove(TileId id) {
  wanted_.erase(id);
  if (known_.erase(id) > 0) removed_.insert(id);
}

RegionNews RegionWatch::take_news(TileSet fetched) {
  RegionNews news{.map = map_, .appeared = {}, .changed = {}, .removed = {}};
  if (fetched.map.map_id == map_.map_id) {
    for (const TileId id : fetched.missing) remove(id);
    for (Tile& tile : fetched.tiles) {
      wanted_.erase(tile.info.id);
      const bool is_replaced = removed_.erase(tile.info.id) > 0;
      const bool is_known = !known_.insert(tile.info.id).second || is_replaced;
      (is_known ? news.changed : news.appeared).push_back(std::move(tile));
    }
  }
  news.removed.assign(removed_.begin(), removed_.end());
  removed_.clear();
  return news;
}

}  // namespace stillmap
