#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// Counters that decide whether a voxel is shown.
struct VoxelHistory {
  static constexpr std::uint16_t max_misses = 1000;
  /// In place of misses: hidden as the rest of something that moved on, until it is seen again.
  static constexpr std::uint16_t misses_of_rest = max_misses + 1;

  /// Scans that hit it, and scans that saw through it.
  std::uint16_t hits = 0;
  std::uint16_t misses = 0;
  bool was_shown = false;
  bool is_restored = false;
  /// One beam alone hit something thin in it.
  bool is_thin = false;
  friend bool operator==(const VoxelHistory&, const VoxelHistory&) = default;
};

/// Why a voxel is not in the planning view.
struct HiddenState {
  VoxelHistory history;
  /// Empty: it was hit too rarely to be shown.
  std::optional<RemovalReason> reason;
  friend bool operator==(const HiddenState&, const HiddenState&) = default;
};

/// A voxel that only movable objects hit.
struct ExcludedVoxel {
  VoxelIndex index;
  SemanticClass label = SemanticClass::unlabeled;
  bool was_moving = false;
  std::int64_t last_seen_ns = 0;
  friend bool operator==(const ExcludedVoxel&, const ExcludedVoxel&) = default;
};

/// State of a tile beyond the voxels that it shows: with both, mapping resumes as if the tile had
/// stayed in memory.
struct TileEvidence {
  TileId id;
  /// Of the tile's voxels, in their order.
  std::vector<VoxelHistory> shown;
  /// Voxels that are not in the planning view, sorted by index, and why.
  PackedVoxels hidden;
  std::vector<HiddenState> hidden_states;
  /// Sorted by index.
  std::vector<ExcludedVoxel> excluded;
};

/// The complete state of a tile.
struct TileRecord {
  /// Null when nothing of it is shown.
  std::shared_ptr<const Tile> tile;
  /// Null when no more is known than the voxels shown.
  std::shared_ptr<const TileEvidence> evidence;
};

/// The voxels that are removed from the planning view, with their reasons.
[[nodiscard]] std::vector<RemovedVoxel> removed_voxels(const TileEvidence& evidence,
                                                       double voxel_size_m, double tile_size_m);

/// Backing store of tiles that are not in memory. Thread-safe.
class TileStore {
 public:
  virtual ~TileStore() = default;
  /// The tile as it was stored last; an empty record when it never was. Throws std::runtime_error
  /// with the reason when it cannot be read.
  [[nodiscard]] virtual TileRecord load(TileId id) = 0;
};

}  // namespace stillmap
