#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <stdexcept>

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
  [[nodiscard]] std::shared_ptr<TileStore> tile_store();
  [[nodiscard]] std::shared_ptr<const Tile> find_cached(const TileInfo& wanted);
  void cache(std::shared_ptr<const Tile> tile);

  std::shared_ptr<TileStore> tile_store_;
  std::size_t cache_bytes_;
  std::mutex mutex_;
  /// Most recently used first.
  std::list<std::shared_ptr<const Tile>> cache_;
  std::size_t bytes_ = 0;
};

}  // namespace stillmap
