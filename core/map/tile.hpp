#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/lidar/semantic_class.hpp"
#include "core/map/packed_voxels.hpp"
#include "core/map/tile_table.hpp"
#include "core/map/voxel.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Identifies the state of a tile: tells a client whether its copy is current.
struct TileInfo {
  TileId id;
  /// Version of the map in which the tile last changed: what changed since version v is every
  /// tile whose revision is above v.
  std::uint64_t revision = 0;
  /// Hash of the tile's voxels; equal content has equal hashes, whatever its history.
  std::uint64_t content_hash = 0;
  /// Smallest box around the voxels' means, map frame [m].
  Eigen::AlignedBox3f bounds_map;
  std::uint32_t voxel_count = 0;
  /// Version of the map in which the tile appeared; 0: before this run of the map began. Known to
  /// the mapping process alone.
  std::uint64_t appeared_in = 0;
};

/// An immutable tile; voxels sorted by index.
struct Tile {
  TileInfo info;
  PackedVoxels voxels;
};

/// An immutable state of the whole map; cheap to copy, safe to read from any thread.
struct MapSnapshot {
  /// Grows with every change of the map; 0 is the empty map.
  std::uint64_t version = 0;
  /// Distinguishes maps: changes with reset and load, so that versions of different maps are never
  /// compared.
  std::uint64_t map_id = 0;
  double tile_size_m = 0.0;
  double voxel_size_m = 0.0;
  TileTable tiles;
};

/// Why a place that was hit is not in the planning view.
enum class RemovalReason : std::uint8_t {
  /// Only objects that were seen moving were there.
  moving,
  /// Objects that stood still, but can move, were there.
  semi_static,
  /// It was shown, but rays keep passing through it.
  seen_through,
  /// It was shown, but later scans classified it as movable.
  relabelled,
};
inline constexpr int removal_reason_count = 4;

/// In words, for people.
[[nodiscard]] std::string_view name(RemovalReason reason);

/// A voxel that is kept out of the planning view, and why.
struct RemovedVoxel {
  Eigen::Vector3f position_map = Eigen::Vector3f::Zero();
  SemanticClass label = SemanticClass::unlabeled;
  RemovalReason reason = RemovalReason::moving;
  std::int64_t last_seen_ns = 0;
};

/// Whether the tile's voxels are in a tile store: its info counts them, but they are not here.
[[nodiscard]] inline bool is_non_resident(const Tile& tile) {
  return tile.voxels.size() != tile.info.voxel_count;
}

/// The tile without its voxels: what snapshots hold in place of a non-resident tile.
[[nodiscard]] inline std::shared_ptr<const Tile> without_voxels(const Tile& tile) {
  return std::make_shared<const Tile>(Tile{tile.info, {}});
}

/// Hash of what a client sees of a tile: of every voxel its index, its winning class and its mean
/// to an eighth of a voxel. Counts, evidence and times are not content: they change with every
/// scan and no plan depends on them. Voxels must be sorted by index.
[[nodiscard]] std::uint64_t content_hash(std::span<const PackedVoxel> voxels);

/// The tile of these voxels, sorted by index, with its hash and bounds.
[[nodiscard]] Tile make_tile(TileId id, std::uint64_t revision, PackedVoxels voxels);
[[nodiscard]] Tile make_tile(TileId id, std::uint64_t revision, std::span<const Voxel> voxels,
                             const VoxelGrid& grid);

/// The tile of this id; null when the snapshot has none.
[[nodiscard]] std::shared_ptr<const Tile> find_tile(const MapSnapshot& view, TileId id);

}  // namespace stillmap
