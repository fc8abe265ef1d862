#pragma once

#include <map>
#include <set>
#include <span>

#include "clients/library/client.hpp"
#include "core/map/query/region_shape.hpp"

namespace stillmap {

/// What a client knows of the tiles of a region, and what it has to fetch: from entries of the
/// tile index to news. Not thread-safe.
class RegionWatch {
 public:
  /// Throws std::invalid_argument for a region with faults.
  RegionWatch(const Region& region, double tile_size_m)
      : region_(region), tile_size_m_(tile_size_m) {}

  void note(const MapIdentity& map, const TileInfo& info);

  /// Tiles that changed and are not fetched yet.
  [[nodiscard]] std::vector<TileId> wanted() const { return {wanted_.begin(), wanted_.end()}; }
  [[nodiscard]] bool has_news() const { return !wanted_.empty() || !removed_.empty(); }

  /// Takes the tiles that were wanted; what they and the entries so far say is no news from now
  /// on. Tiles of another map are left for when the index speaks of that map.
  [[nodiscard]] RegionNews take_news(TileSet fetched);

 private:
  void forget_all();
  void remove(TileId id);

  RegionShape region_;
  double tile_size_m_;
  MapIdentity map_;
  std::set<TileId> known_;
  std::set<TileId> wanted_;
  std::set<TileId> removed_;
};

}  // namespace stillmap
