#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "core/map/tile_table.hpp"
#include "core/map/voxel.hpp"

namespace stillmap {

struct MapSnapshot;

/// The map frame cut into tiles, and tiles into voxels.
class VoxelGrid {
 public:
  /// Positions farther from the map's origin than this, in any axis, belong to no voxel: beyond
  /// it a float resolves a voxel's mean no better than 8 mm.
  static constexpr double max_coordinate_m = 100'000.0;
  /// Voxels along the side of a tile: column, row and layer together fit 32 bits.
  static constexpr int max_columns = 256;

  /// `tile_size_m` is a whole number of voxels, at most `max_columns`.
  VoxelGrid(double voxel_size_m, double tile_size_m)
      : voxel_size_m_(voxel_size_m),
        columns_(static_cast<int>(std::lround(tile_size_m / voxel_size_m))),
        tiles_per_voxel_(1.0 / columns_),
        max_z_m_(std::min(max_coordinate_m,
                          // Layers are kept one off the ends of int16.
                          voxel_size_m * (std::numeric_limits<std::int16_t>::max() - 1))) {}

  [[nodiscard]] double voxel_size_m() const { return voxel_size_m_; }
  [[nodiscard]] double tile_size_m() const { return voxel_size_m_ * columns_; }
  /// Voxels along the side of a tile.
  [[nodiscard]] int columns() const { return columns_; }
  /// Nothing higher or lower than this has a voxel.
  [[nodiscard]] double max_z_m() const { return max_z_m_; }

  struct Index {
    TileId tile;
    VoxelIndex voxel;
    /// From the voxel's lowest corner, in voxels: 0..1.
    Eigen::Vector3d offset;
  };

  /// Whether the position has a voxel: finite, and not too far from the origin.
  [[nodiscard]] bool holds(const Eigen::Vector3d& p_map) const {
    // Written so that NaN fails every comparison, and without branches.
    return (std::abs(p_map.x()) <= max_coordinate_m) & (std::abs(p_map.y()) <= max_coordinate_m) &
           (std::abs(p_map.z()) <= max_z_m_);
  }

  /// Requires holds(p_map).
  [[nodiscard]] Index index(const Eigen::Vector3d& p_map) const {
    const Eigen::Vector3d in_voxels = p_map / voxel_size_m_;
    const Eigen::Vector3d whole = in_voxels.array().floor();
    const Eigen::Vector3i voxel = whole.cast<int>();
    const TileId tile{tile_of(voxel.x()), tile_of(voxel.y())};
    return {tile,
            {static_cast<std::uint16_t>(voxel.x() - tile.x * columns_),
             static_cast<std::uint16_t>(voxel.y() - tile.y * columns_),
             static_cast<std::int16_t>(voxel.z())},
            in_voxels - whole};
  }

  /// The voxel's lowest corner, map frame [m].
  [[nodiscard]] Eigen::Vector3d corner_map(TileId tile, VoxelIndex voxel) const;

 private:
  [[nodiscard]] std::int32_t tile_of(int voxel) const {
    // Half a voxel from the tile's border, so that rounding cannot cross it.
    return static_cast<std::int32_t>(std::floor((voxel + 0.5) * tiles_per_voxel_));
  }

  double voxel_size_m_;
  int columns_;
  double tiles_per_voxel_;
  double max_z_m_;
};

/// The column of a tile, all heights, and a little round it: a mean in float may lie just outside.
[[nodiscard]] Eigen::AlignedBox3d tile_footprint(TileId id, double tile_size_m);

/// Ids first.x .. last.x by first.y .. last.y.
struct TileRange {
  TileId first;
  TileId last;
};
/// The tiles whose footprint meets the box (map frame [m]; faces may be infinite, NaN must not be).
[[nodiscard]] TileRange tile_range(const Eigen::AlignedBox3d& box_map, double tile_size_m);

/// The tiles of these ids, sorted by id: of those from `from` on, the first `max_tiles`.
[[nodiscard]] std::vector<std::shared_ptr<const Tile>> tiles_in_range(
    const TileTable& tiles, const TileRange& range,
    std::size_t max_tiles = std::numeric_limits<std::size_t>::max(),
    TileId from = {std::numeric_limits<std::int32_t>::min(),
                   std::numeric_limits<std::int32_t>::min()});

/// Sorted by id, the tiles whose bounds meet the box (map frame [m], faces included, infinite faces
/// allowed). Empty for a box with NaN or min > max.
[[nodiscard]] std::vector<std::shared_ptr<const Tile>> tiles_in_box(
    const MapSnapshot& view, const Eigen::AlignedBox3d& box_map);

}  // namespace stillmap
