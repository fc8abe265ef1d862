#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <unordered_map>

#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"

namespace stillmap {

/// The tile store has another state of the tile than the snapshot: query a newer snapshot.
class TileChanged : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads tiles of snapshots, resident or not, and caches the last ones read from the tile store, so
/// that repeated queries of a region read it once. Thread-safe.
class TileReader {
 public:
  /// Without a tile store, every tile must have its voxels. Caches about `cache_bytes`.
  explicit TileReader(std::shared_ptr<TileStore> tile_store = nullptr, std::size_t cache_bytes = 0);

  /// Replaces the tile store and empties the cache.
  void use_tile_store(std::shared_ptr<TileStore> tile_store);

  /// The tile with its voxels. Throws TileChanged, or as the tile store does.
  [[nodiscard]] std::shared_ptr<const Tile> read(const std::shared_ptr<const Tile>& tile);

 private:
  using Cache = std::list<std::shared_ptr<const Tile>>;
  struct StateHash {
    std::size_t operator()(const TileInfo& info) const;
  };
  struct IsSameState {
    bool operator()(const TileInfo& a, const TileInfo& b) const;
  };

  [[nodiscard]] std::shared_ptr<TileStore> tile_store();
  [[nodiscard]] std::shared_ptr<const Tile> find_cached(const TileInfo& wanted);
  void cache(std::shared_ptr<const Tile> tile);
  void drop_oldest();

  std::shared_ptr<TileStore> tile_store_;
  std::size_t cache_bytes_;
  std::mutex mutex_;
  /// Most recently used first.
  Cache cache_;
  /// Where each state is in it: thousands of small tiles fit in.
  std::unordered_map<TileInfo, Cache::iterator, StateHash, IsSameState> entries_;
  std::size_t bytes_ = 0;
};

}  // namespace stillmap
