#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/map/live_tile.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/scan_stamps.hpp"
#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Moves voxels to where a correction of the map takes them: as poses of the time at which each was
/// first seen, and places of objects as those at which they were last seen: these by whole voxels,
/// rounded another way by each correction, so that many small ones add up.
class TileCorrection {
 public:
  /// All must outlive it. Nothing moves into tiles that are not open. `number`: of the correction.
  TileCorrection(const MapCorrection& correction, const VoxelGrid& grid, const ScanStamps& stamps,
                 std::function<bool(TileId)> is_open, std::uint64_t number);

  /// A voxel of the corrected map.
  struct Voxel {
    TileId tile;
    LiveTile::LiveVoxel live;
    Eigen::Vector3f mean_map = Eigen::Vector3f::Zero();
    /// Its home: where it were, had it moved by whole voxels. Of voxels that move alike, each has a
    /// home of its own.
    TileId tile_by_whole;
    std::uint32_t key_by_whole = 0;
  };
  /// The place of an object that is no voxel.
  struct Place {
    TileId tile;
    std::uint32_t key = 0;
    LiveTile::Excluded excluded;
  };
  struct Moved {
    std::vector<Voxel> voxels;
    std::vector<Place> places;
  };

  /// Takes out of the tile what moves. May be called for several tiles at once.
  [[nodiscard]] Moved take(LiveTile& tile) const;
  /// Adds voxels that are of this tile now. One that meets a voxel that did not move becomes one
  /// with it, which counts as missed as often as the one of both that was missed less: rays through
  /// the other started at a wrong pose. One that would meet another that moved, as those do whose
  /// means lay close, goes to its home: a wall that moved has no holes.
  void put(LiveTile& tile, Moved moved) const;

 private:
  [[nodiscard]] std::optional<Voxel> moved(const LiveTile& tile,
                                           const LiveTile::LiveVoxel& voxel) const;
  [[nodiscard]] std::optional<Place> moved(const LiveTile& tile, std::uint32_t key,
                                           const LiveTile::Excluded& excluded) const;
  [[nodiscard]] std::optional<Eigen::Vector3d> new_position(const Eigen::Vector3d& position_map,
                                                            std::uint32_t scan) const;
  void put(LiveTile& tile, const Voxel& voxel) const;
  [[nodiscard]] Voxel at_home(const Voxel& voxel) const;
  void merge(const LiveTile& tile, LiveTile::LiveVoxel& known, const Voxel& other) const;

  const MapCorrection& correction_;
  const VoxelGrid& grid_;
  const ScanStamps& stamps_;
  std::function<bool(TileId)> is_open_;
  /// Added to places before they are rounded [m]: below half a voxel.
  Eigen::Vector3d rounding_m_;
};

}  // namespace stillmap
