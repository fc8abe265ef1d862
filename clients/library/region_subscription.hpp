#pragma once

#include <cstdint>
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

  /// An entry of a tile that was fetched in this state, or a newer one, changes nothing. One of
  /// another map ends the map before, whatever edge its tiles have.
  void add_index_entry(const dds::MapIdentity& map, const TileInfo& info);
  /// All tiles of the region.
  void add_present(const TileVersions& present);
  /// Which map there is, as the server's status tells: the index may never speak of one that has no
  /// tile here.
  void note_map(std::uint64_t map_id);
  /// Whether another map began since `add_present`: the index has only tiles of it that are round
  /// the robot, or changed.
  [[nodiscard]] bool lacks_present() const {
    return is_other_map_noted_ || listed_map_id_ != map_.map_id;
  }

  /// Edge of the map's tiles [m].
  [[nodiscard]] double tile_size_m() const { return tile_size_m_; }

  /// Tiles that changed and are not fetched yet.
  [[nodiscard]] std::vector<TileId> pending() const { return {pending_.begin(), pending_.end()}; }
  [[nodiscard]] bool has_update() const { return !pending_.empty() || !removed_.empty(); }

  /// Takes the tiles that were pending; the next update holds only what changes from now on. Tiles
  /// of another map stay pending until the index has that map.
  [[nodiscard]] RegionUpdate take_update(TileSet fetched);

 private:
  void begin_map(const dds::MapIdentity& map);
  void remove(TileId id);

  RegionShape region_;
  double tile_size_m_;
  dds::MapIdentity map_;
  std::uint64_t listed_map_id_ = 0;
  std::uint64_t noted_map_id_ = 0;
  bool is_other_map_noted_ = false;
  /// With their revisions.
  std::map<TileId, std::uint64_t> known_;
  std::set<TileId> pending_;
  std::set<TileId> removed_;
};

using FetchTiles = std::function<TileSet(std::span<const TileId>)>;
using ListTiles = std::function<TileVersions()>;

/// A reader of the region's part of the tile index, one of the status, which tells when another map
/// began, and the thread that makes updates of the entries, fetching changed tiles. `list` tells
/// the region's tiles: the first update has them, and that of another map, since the index has but
/// those round the robot. Throws what `list` throws; later `list` and `fetch` may throw
/// ServiceError, and are then called again.
[[nodiscard]] Subscription make_region_subscription(
    dds::Participant& participant, const dds::Topics& topics, const Region& region, ListTiles list,
    FetchTiles fetch, std::function<void(const RegionUpdate&)> update_arrived);

}  // namespace stillmap
