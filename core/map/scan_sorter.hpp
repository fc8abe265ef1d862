#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/live_tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Sorts the points of a scan by the tile they fall into. Keeps its memory from scan to scan.
class ScanSorter {
 public:
  ScanSorter(const VoxelGrid& grid, double max_range_m);

  /// The points of one tile, in the order of the scan.
  struct Batch {
    TileId tile;
    std::span<const TilePoint> points;
  };

  /// Tiles hit by points that are mapped: finite, and within range; none where the transform is not
  /// finite and rigid. The batches are valid until the
  /// next call. `is_thin`: of each point (StaticMap::insert), or empty.
  [[nodiscard]] std::span<const Batch> sort(const LabelledScan& scan,
                                            const Eigen::Isometry3d& T_map_lidar,
                                            std::span<const std::uint8_t> is_thin);

 private:
  /// A square of tiles round the lidar; every point within range falls into it.
  struct Window {
    TileId first;
    std::int32_t side = 0;
  };

  /// The pose in voxels.
  class PoseInVoxels {
   public:
    PoseInVoxels(const Eigen::Isometry3d& T_map_lidar, double voxel_size_m);

    /// A coordinate of a point's place in the map [voxels].
    [[nodiscard]] double along(Eigen::Index axis, double x, double y, double z) const {
      return in_voxels_(axis, 0) * x + in_voxels_(axis, 1) * y + in_voxels_(axis, 2) * z +
             in_voxels_(axis, 3);
    }

   private:
    Eigen::Matrix<double, 3, 4> in_voxels_;
  };

  struct LanesPlaced;

  void index_points(const Scan& scan, const Eigen::Isometry3d& T_map_lidar, const Window& window);
  /// Of the points from `first` on, of which there are so many at most as are placed at once.
  void index_some(std::size_t first, std::size_t count, const Scan& scan, const PoseInVoxels& pose,
                  const Window& window);
  void group_by_tile(const LabelledScan& scan, std::span<const std::uint8_t> is_thin,
                     const Window& window);

  VoxelGrid grid_;
  double max_range_m_;
  std::int32_t reach_tiles_;
  /// Of every point of the scan: its place in the window (`no_tile` when not mapped), its voxel,
  /// and where in it, eight bits an axis.
  std::vector<std::uint32_t> window_indices_, voxel_keys_;
  std::vector<std::int32_t> offsets_;
  /// Where each tile of the window begins in `grouped_`, and one past the last.
  std::vector<std::uint32_t> begins_;
  std::vector<TilePoint> grouped_;
  std::vector<Batch> batches_;
};

}  // namespace stillmap
