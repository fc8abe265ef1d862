#pragma once

#include <tsl/robin_map.h>

#include <Eigen/Geometry>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/lidar/voxel_index.hpp"
#include "core/map/live_tile.hpp"
#include "core/map/scan_stamps.hpp"
#include "core/map/static_map.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Why a tile could not be read. It is tried again, not soon and less and less often: the disk may
/// recover, and until then each attempt may take it long.
class ReadFault {
 public:
  [[nodiscard]] const std::string& text() const { return text_; }
  void set_text(std::string text) { text_ = std::move(text); }
  /// To be asked whenever the tile is wanted: true the 16th time, the 32nd, 64th and so on, and
  /// every 1024th.
  [[nodiscard]] bool is_next_attempt_due() {
    constexpr std::uint32_t first_wait = 16;
    constexpr std::uint32_t longest_wait = 1024;
    ++wanted_;
    return (wanted_ >= first_wait && std::has_single_bit(wanted_)) || wanted_ % longest_wait == 0;
  }

 private:
  std::string text_;
  std::uint32_t wanted_ = 0;
};

/// The tiles of the map that is written to: those in memory, and those that are in the tile store
/// alone. Knows what the last view shows of each, and what is not stored yet. NOT thread-safe.
class MapTiles {
 public:
  /// Requires a configuration without faults.
  explicit MapTiles(const StaticMapConfig& config);

  /// No tiles, as another map.
  void clear(std::uint64_t map_id);
  /// Tiles without voxels, and those whose evidence is null, are taken to be in the tile store.
  void resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence);

  [[nodiscard]] const VoxelGrid& grid() const { return grid_; }
  /// When the scans were that voxels of tiles in memory name.
  [[nodiscard]] ScanStamps& stamps() { return stamps_; }
  [[nodiscard]] const ScanStamps& stamps() const { return stamps_; }

  /// A tile in memory, one from the tile store, or a new one; null when it cannot be read.
  [[nodiscard]] LiveTile* tile(TileId id);
  /// Null when it is not in memory.
  [[nodiscard]] LiveTile* resident(TileId id) const;
  [[nodiscard]] bool is_known_non_resident(TileId id) const;
  /// All tiles in memory, sorted by id.
  [[nodiscard]] std::vector<LiveTile*> residents() const;
  /// Tiles of the tile store alone whose footprint comes this near.
  [[nodiscard]] std::vector<TileId> non_resident_near(const Eigen::Vector3d& position_map,
                                                      double range_m) const;
  /// About what a tile of the tile store will take in memory.
  [[nodiscard]] std::size_t expected_bytes(TileId id) const;
  /// Tiles in memory whose footprint comes this near.
  [[nodiscard]] std::vector<LiveTile*> near(const Eigen::Vector3f& position_map,
                                            double range_m) const;
  /// As StaticMap::tiles_in.
  [[nodiscard]] std::vector<TileId> in(const Eigen::AlignedBox3d& box_map,
                                       std::size_t max_shown) const;

  /// What is touched from now on changed in another step than what was until now. Returns the step
  /// that ends.
  std::uint64_t begin_step() { return step_++; }
  /// The tile changed in this step; `is_published`: what it shows may have, too.
  void touch(LiveTile& live, bool is_published = true);

  /// Looks at it for the next view, though nothing changed it.
  void publish_again(LiveTile& live) { touched_.push_back(&live); }
  /// As StaticMap::view.
  [[nodiscard]] std::shared_ptr<const MapSnapshot> view(const VisibilityRule& rule);

  void use_store(std::shared_ptr<TileStore> store) { store_ = std::move(store); }
  /// Reads a non-resident tile from the tile store; false when it cannot be read, or could not
  /// lately.
  bool reload(TileId id);
  /// The same, however lately it could not.
  bool reload_now(TileId id);
  /// Reloads the tiles whose footprint comes this near.
  void reload_near(const Eigen::Vector3d& position_map, double range_m);
  /// Evicts stored tiles that are farther than this, farthest first, until the map takes no more
  /// than `limit_bytes`. Returns how many.
  std::size_t evict(const Eigen::Vector2d& position_map, double range_m, std::size_t limit_bytes);
  /// Tiles that could not be read, with the reason.
  [[nodiscard]] const std::map<TileId, ReadFault>& unreadable() const { return unreadable_; }
  [[nodiscard]] MemoryUse memory_use() const;

  [[nodiscard]] std::vector<LiveTile*> to_store(CheckpointScope scope) const;
  /// Nothing is in the tile store any more: the tiles of it alone are gone, but for these, and what
  /// is in memory is to be stored. Returns how many are gone.
  std::size_t forget_stored(std::span<const TileId> kept);
  /// What is in memory is to be stored again before it is evicted.
  void keep_in_memory();
  /// The tile is stored as it was at the end of this step.
  void stored(TileId id, std::uint64_t step);

 private:
  /// A tile in memory.
  struct Resident {
    std::unique_ptr<LiveTile> live;
    /// Step in which it last changed.
    std::uint64_t changed_at = 0;
  };
  struct IdHash {
    std::size_t operator()(const TileId& id) const {
      const auto x = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.x));
      const auto y = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.y));
      return IndexHash{}(x << 32 | y);
    }
  };

  /// What the last view, or the next one, has of the tile; null where it shows nothing.
  [[nodiscard]] std::shared_ptr<const Tile> shown(TileId id) const;
  void add(TileId id, const TileRecord& record);
  void evict(TileId id);
  /// From the tile's footprint [m].
  [[nodiscard]] double distance_m(TileId id, const Eigen::Vector2d& position_map) const;
  [[nodiscard]] std::size_t memory_bytes() const;

  VoxelGrid grid_;
  /// As configured: the grid rounds to whole voxels.
  double tile_size_m_;
  ScanStamps stamps_;
  tsl::robin_map<TileId, Resident, IdHash> residents_;
  /// In the tile store alone, and without any voxel to show. Other tiles that are not in
  /// `residents_` but in the view are there, too.
  std::set<TileId> hidden_non_resident_;
  /// Both kinds.
  std::size_t non_resident_count_ = 0;
  std::shared_ptr<TileStore> store_;
  std::map<TileId, ReadFault> unreadable_;
  /// Tiles with points since the last view; a tile may be named more than once.
  std::vector<LiveTile*> touched_;
  /// What the next view shows otherwise than the last one.
  std::map<TileId, std::shared_ptr<const Tile>> edits_;
  /// Tiles in memory that changed since they were stored.
  std::set<TileId> unsaved_;
  /// Counts the changes of tiles.
  std::uint64_t step_ = 1;
  /// The last view.
  std::shared_ptr<const MapSnapshot> current_;
};

}  // namespace stillmap
