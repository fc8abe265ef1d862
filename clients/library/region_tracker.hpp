#pragma once

#include <map>
#include <set>
#include <span>

#include "clients/library/client.hpp"
#include "core/map/query/region.hpp"

namespace stillmap {

/// What a client knows of the tiles of a region, and what it has to fetch: from entries of the
/// tile index to updates. Not thread-safe.
class RegionTracker {
 public:
  /// Throws std::invalid_argument for a region with faults.
  RegionTracker(const Region& region, double tile_size_m)
      : region_(region), tile_size_m_(tile_size_m) {}

  void add_index_entry(const dds::MapIdentity& map, const TileInfo& info);

  /// Tiles that changed and are not fetched yet.
  [[nodiscard]] std::vector<TileId> pending() const { return {pending_.begin(), pending_.end()}; }
  [[nodiscard]] bool has_update() const { return !pending_.empty() || !removed_.empty(); }

  /// Takes the tiles that were pending; what they and the entries so far say is in no later update
  /// from now on. Tiles of another map are left for when the index speaks of that map.
  [[nodiscard]] RegionUpdate take_update(TileSet fetched);

 private:
  void clear();
  void remove(TileId id);

  RegionShape region_;
  double tile_size_m_;
  dds::MapIdentity map_;
  std::set<TileId> known_;
  std::set<TileId> pending_;
  std::set<TileId> removed_;
};

}  // namespace stillmap
