#pragma once

#include "core/map/tile_evidence.hpp"

namespace stillmap {

/// Where tiles are that left memory. Thread-safe.
class TileStore {
 public:
  virtual ~TileStore() = default;
  /// All that was stored of the tile last; nothing of a tile that was never stored. Throws
  /// std::runtime_error that says why it cannot be read.
  [[nodiscard]] virtual TileRecord load(TileId id) = 0;
};

/// Whether the tile's voxels are in a tile store: its info counts them, but they are not here.
[[nodiscard]] inline bool is_non_resident(const Tile& tile) {
  return tile.voxels.size() != tile.info.voxel_count;
}

/// The tile without its voxels: what views have in place of one that is non-resident.
[[nodiscard]] inline std::shared_ptr<const Tile> without_voxels(const Tile& tile) {
  return std::make_shared<const Tile>(Tile{tile.info, {}});
}

}  // namespace stillmap
