#pragma once

#include <tsl/robin_map.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/map/live_tile.hpp"
#include "core/map/scan_sorter.hpp"
#include "core/map/static_map.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

struct TileIdHash {
  std::size_t operator()(const TileId& id) const {
    const auto x = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.x));
    const auto y = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.y));
    return static_cast<std::size_t>(((x << 32 | y) * 0x9E3779B97F4A7C15ULL) >> 20);
  }
};

/// What static_map.cpp and static_map_paging.cpp share.
struct StaticMap::State {
  /// A tile in memory.
  struct Resident {
    std::unique_ptr<LiveTile> live;
    /// Step of the map in which it last changed.
    std::uint64_t changed_at = 0;
  };

  explicit State(const StaticMapConfig& map_config);

  void clear(std::uint64_t map_id);
  [[nodiscard]] VisibilityRule rule() const {
    return {config.min_points, config.misses_to_clear, config.misses_per_hit};
  }
  /// A new tile, one in memory, or one from the tile store; null when the tile store cannot read
  /// it.
  [[nodiscard]] LiveTile* tile(TileId id);
  /// Has the tile, which is non-resident, in memory again; false when the tile store cannot read
  /// it.
  bool reload(TileId id);
  /// The tile changed in this step.
  void touch(LiveTile& live);
  /// Tiles in memory whose footprint comes this near.
  [[nodiscard]] std::vector<LiveTile*> tiles_near(const Eigen::Vector3f& position_map,
                                                  double range_m) const;
  /// From the tile's footprint [m].
  [[nodiscard]] double distance_m(TileId id, const Eigen::Vector2d& position_map) const;
  [[nodiscard]] std::vector<std::shared_ptr<const Tile>> published_tiles() const;
  [[nodiscard]] std::size_t memory_bytes() const;

  StaticMapConfig config;
  VoxelGrid grid;
  ScanSorter sorter;
  tsl::robin_map<TileId, Resident, TileIdHash> tiles;
  /// In the tile store: what views show of them, null where that is nothing.
  std::map<TileId, std::shared_ptr<const Tile>> non_resident;
  std::shared_ptr<TileStore> tile_store;
  /// Why tiles that are non-resident could not be read.
  std::map<TileId, std::string> unreadable;
  /// Tiles with points since the last view; a tile may be named more than once.
  std::vector<LiveTile*> touched;
  /// Tiles left memory or came back since the last view.
  bool residency_changed = false;
  /// Scans so far.
  std::uint64_t inserted = 0;
  /// Counts everything that changes tiles, and how far of it is in the tile store.
  std::uint64_t step = 1;
  std::uint64_t stored_step = 0;
  /// The last view.
  std::shared_ptr<const MapSnapshot> current;
};

}  // namespace stillmap
