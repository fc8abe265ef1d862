#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/map/removed_voxel.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

/// How a voxel came to be shown or hidden.
struct VoxelPast {
  /// Scans that hit it, and scans that looked through it.
  std::uint16_t hits = 0;
  std::uint16_t passes = 0;
  bool was_shown = false;
  bool is_restored = false;
  friend bool operator==(const VoxelPast&, const VoxelPast&) = default;
};

/// A voxel that is not in the planning view.
struct HiddenVoxel {
  Voxel voxel;
  VoxelPast past;
  /// Nothing: it was hit too rarely to be shown.
  std::optional<RemovalReason> reason;
};

/// A place that only movable things hit.
struct ExcludedPlace {
  VoxelIndex index;
  SemanticClass label = SemanticClass::unlabeled;
  bool was_moving = false;
  std::int64_t last_seen_ns = 0;
};

/// What is known of a tile beside the voxels that it shows: with both, mapping goes on as if the
/// tile had never left memory.
struct TileMemory {
  TileId id;
  /// Of the tile's voxels, in their order.
  std::vector<VoxelPast> shown;
  /// Sorted by index.
  std::vector<HiddenVoxel> hidden;
  /// Sorted by index.
  std::vector<ExcludedPlace> excluded;
};

/// All of a tile.
struct TileRecord {
  /// Null when nothing of it is shown.
  std::shared_ptr<const Tile> tile;
  /// Null when no more is known than what is shown.
  std::shared_ptr<const TileMemory> memory;
};

/// The places that the memory keeps out of the planning view, with their reasons.
[[nodiscard]] std::vector<RemovedVoxel> removed_voxels(const TileMemory& memory,
                                                       double voxel_size_m, double tile_size_m);

/// A memory as bytes, nothing lost: a version byte, then a zstd frame (with checksum) of i32 x,
/// i32 y, three u32 counts, and the three lists by byte planes. All little-endian.
[[nodiscard]] std::vector<std::uint8_t> encode_memory(const TileMemory& memory);

/// Throws TileCodecError for whatever encode_memory did not write; reads nothing beyond `bytes`.
[[nodiscard]] TileMemory decode_memory(std::span<const std::uint8_t> bytes);

}  // namespace stillmap
