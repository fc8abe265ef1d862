#pragma once

#include <functional>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "clients/library/client.hpp"
#include "core/map/query/region.hpp"
#include "idl/dds/participant.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap {

/// Which tiles of a region a client has and which it must fetch: makes updates from entries of the
/// tile index. Not thread-safe.
class RegionTracker {
 public:
  /// Throws std::invalid_argument for a region with faults.
  RegionTracker(const Region& region, double tile_size_m)
      : region_(region), tile_size_m_(tile_size_m) {}

  /// An entry of a tile that was fetched in this state, or a newer one, changes nothing.
  void add_index_entry(const dds::MapIdentity& map, const TileInfo& info);

  /// Tiles that changed and are not fetched yet.
  [[nodiscard]] std::vector<TileId> pending() const { return {pending_.begin(), pending_.end()}; }
  [[nodiscard]] bool has_update() const { return !pending_.empty() || !removed_.empty(); }

  /// Takes the tiles that were pending; the next update holds only what changes from now on. Tiles
  /// of another map stay pending until the index has that map.
  [[nodiscard]] RegionUpdate take_update(TileSet fetched);

 private:
  void clear();
  void remove(TileId id);

  RegionShape region_;
  double tile_size_m_;
  dds::MapIdentity map_;
  /// With their revisions.
  std::map<TileId, std::uint64_t> known_;
  std::set<TileId> pending_;
  std::set<TileId> removed_;
};

using FetchTiles = std::function<TileSet(std::span<const TileId>)>;

/// A reader of the region's part of the tile index, and the thread that makes updates of its
/// entries, fetching changed tiles. `present` are the region's tiles: the first update has them,
/// since the index has but those round the robot. `fetch` may throw ServiceError; it is then called
/// again later.
[[nodiscard]] Subscription make_region_subscription(
    dds::Participant& participant, const dds::TopicSpec<stillmap_msgs::msg::TileInfo>& index,
    const Region& region, const TileVersions& present, FetchTiles fetch,
    std::function<void(const RegionUpdate&)> update_arrived);

}  // namespace stillmap
