#pragma once

#include "core/map/tile_evidence.hpp"

namespace stillmap {

/// Where tiles are that left memory. Thread-safe.
class TileShelf {
 public:
  virtual ~TileShelf() = default;
  /// All that was stored of the tile last; nothing of a tile that was never stored. Throws
  /// std::runtime_error that says why it cannot be read.
  [[nodiscard]] virtual TileRecord take(TileId id) = 0;
};

/// Whether the tile's voxels are on a shelf: its info counts them, but they are not here.
[[nodiscard]] inline bool is_away(const Tile& tile) {
  return tile.voxels.size() != tile.info.voxel_count;
}

/// The tile without its voxels: what views have in place of one that is away.
[[nodiscard]] inline std::shared_ptr<const Tile> shelved(const Tile& tile) {
  return std::make_shared<const Tile>(Tile{tile.info, {}});
}

}  // namespace stillmap
