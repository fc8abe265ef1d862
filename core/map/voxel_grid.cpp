#include "core/map/voxel_grid.hpp"

#include <limits>

namespace stillmap {
namespace {

int floor_divide(int a, int b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

}  // namespace

bool VoxelGrid::holds(const Eigen::Vector3d& p_map) const {
  // Written so that NaN fails every comparison. Layers are kept one off the ends of int16.
  const double max_z_m =
      std::min(max_coordinate_m, voxel_size_m_ * (std::numeric_limits<std::int16_t>::max() - 1));
  return std::abs(p_map.x()) <= max_coordinate_m && std::abs(p_map.y()) <= max_coordinate_m &&
         std::abs(p_map.z()) <= max_z_m;
}

VoxelGrid::Index VoxelGrid::index(const Eigen::Vector3d& p_map) const {
  const Eigen::Vector3d in_voxels = p_map / voxel_size_m_;
  const Eigen::Vector3d whole = in_voxels.array().floor();
  const Eigen::Vector3i voxel = whole.cast<int>();
  const TileId tile{floor_divide(voxel.x(), columns_), floor_divide(voxel.y(), columns_)};
  return {tile,
          {static_cast<std::uint16_t>(voxel.x() - tile.x * columns_),
           static_cast<std::uint16_t>(voxel.y() - tile.y * columns_),
           static_cast<std::int16_t>(voxel.z())},
          in_voxels - whole};
}

Eigen::Vector3d VoxelGrid::corner_map(TileId tile, VoxelIndex voxel) const {
  return voxel_size_m_ * Eigen::Vector3d(static_cast<double>(tile.x) * columns_ + voxel.x,
                                         static_cast<double>(tile.y) * columns_ + voxel.y, voxel.z);
}

}  // namespace stillmap
