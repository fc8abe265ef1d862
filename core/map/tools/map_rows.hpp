#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

// A map file's rows as they are read, and what can be wrong with them.

struct MapRow {
  std::uint64_t version = 0;
  double tile_size_m = 0.0;
  double voxel_size_m = 0.0;
};

struct TileRow {
  TileId id;
  std::uint64_t revision = 0;
  std::uint64_t content_hash = 0;
  /// As encode_tile wrote it; valid as long as the database's row.
  std::span<const std::uint8_t> encoded;
};

struct PoseRow {
  std::int64_t stamp_ns = 0;
  /// x y z [m], then the quaternion's x y z w.
  std::array<double, 7> values{};
};

/// Whether tiles are some whole number of voxels wide that a VoxelGrid takes.
[[nodiscard]] bool has_usable_sizes(const MapRow& map);

/// What is wrong with a tile that was decoded from `row`; `map` has usable sizes.
[[nodiscard]] std::vector<std::string> tile_faults(const Tile& tile, const TileRow& row,
                                                   const MapRow& map);

/// What is wrong with a pose that follows `last`.
[[nodiscard]] std::vector<std::string> pose_faults(const PoseRow& pose,
                                                   const std::optional<PoseRow>& last);

}  // namespace stillmap
