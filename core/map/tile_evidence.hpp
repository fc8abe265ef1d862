#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// How a voxel came to be shown or hidden.
struct VoxelHistory {
  /// Scans that hit it, and scans that looked through it.
  std::uint16_t hits = 0;
  std::uint16_t misses = 0;
  bool was_shown = false;
  bool is_restored = false;
  friend bool operator==(const VoxelHistory&, const VoxelHistory&) = default;
};

/// A voxel that is not in the planning view.
struct HiddenVoxel {
  Voxel voxel;
  VoxelHistory history;
  /// Nothing: it was hit too rarely to be shown.
  std::optional<RemovalReason> reason;
};

/// A place that only movable things hit.
struct ExcludedVoxel {
  VoxelIndex index;
  SemanticClass label = SemanticClass::unlabeled;
  bool was_moving = false;
  std::int64_t last_seen_ns = 0;
};

/// What is known of a tile beside the voxels that it shows: with both, mapping goes on as if the
/// tile had never left memory.
struct TileEvidence {
  TileId id;
  /// Of the tile's voxels, in their order.
  std::vector<VoxelHistory> shown;
  /// Sorted by index.
  std::vector<HiddenVoxel> hidden;
  /// Sorted by index.
  std::vector<ExcludedVoxel> excluded;
};

/// All of a tile.
struct TileRecord {
  /// Null when nothing of it is shown.
  std::shared_ptr<const Tile> tile;
  /// Null when no more is known than what is shown.
  std::shared_ptr<const TileEvidence> evidence;
};

/// The places that the evidence keeps out of the planning view, with their reasons.
[[nodiscard]] std::vector<RemovedVoxel> removed_voxels(const TileEvidence& evidence,
                                                       double voxel_size_m, double tile_size_m);

/// Where tiles are that left memory. Thread-safe.
class TileStore {
 public:
  virtual ~TileStore() = default;
  /// All that was stored of the tile last; nothing of a tile that was never stored. Throws
  /// std::runtime_error that says why it cannot be read.
  [[nodiscard]] virtual TileRecord load(TileId id) = 0;
};

}  // namespace stillmap
