#include "core/map/tools/map_rows.hpp"

#include <algorithm>
#include <cmath>

#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// A mean is summed in float and may lie a little outside of its cell; at the edge of the map a
/// float is no finer than 8 mm.
constexpr double mean_slack_m = 0.02;

bool lies_in_its_cell(const Voxel& voxel, TileId tile, const VoxelGrid& grid) {
  const Eigen::Array3d from_corner =
      voxel.mean_map.cast<double>() - grid.corner_map(tile, voxel.index);
  return (from_corner >= -mean_slack_m).all() &&
         (from_corner <= grid.voxel_size_m() + mean_slack_m).all();
}

std::vector<std::string> voxel_faults(const Tile& tile, const VoxelGrid& grid, double columns) {
  const auto is_outside = [&](const Voxel& voxel) {
    return voxel.index.x >= columns || voxel.index.y >= columns;
  };
  const auto is_elsewhere = [&](const Voxel& voxel) {
    return !lies_in_its_cell(voxel, tile.info.id, grid);
  };
  std::vector<std::string> faults;
  if (const auto count = std::ranges::count_if(tile.voxels, is_outside); count > 0) {
    faults.push_back("has " + std::to_string(count) + " voxels outside of the tile");
  } else if (const auto far = std::ranges::count_if(tile.voxels, is_elsewhere); far > 0) {
    faults.push_back("has " + std::to_string(far) + " voxels whose mean lies in another cell");
  }
  return faults;
}

}  // namespace

bool has_usable_sizes(const MapRow& map) {
  const double columns = map.tile_size_m / map.voxel_size_m;
  return map.voxel_size_m > 0.0 && columns >= 0.5 && columns <= VoxelGrid::max_columns + 0.5;
}

std::vector<std::string> tile_faults(const Tile& tile, const TileRow& row, const MapRow& map) {
  const VoxelGrid grid(map.voxel_size_m, map.tile_size_m);
  std::vector<std::string> faults =
      voxel_faults(tile, grid, std::round(map.tile_size_m / map.voxel_size_m));
  if (tile.info.id != row.id) {
    faults.push_back("says that it is tile (" + std::to_string(tile.info.id.x) + ", " +
                     std::to_string(tile.info.id.y) + ")");
  }
  if (tile.info.revision != row.revision || tile.info.content_hash != row.content_hash) {
    faults.emplace_back("does not agree with its row's revision and hash");
  }
  if (content_hash(tile.info.id, tile.voxels, grid) != tile.info.content_hash) {
    faults.emplace_back("does not agree with its content hash");
  }
  if (row.revision > map.version) {
    faults.push_back("has revision " + std::to_string(row.revision) + ", the map is at version " +
                     std::to_string(map.version));
  }
  return faults;
}

std::vector<std::string> pose_faults(const PoseRow& pose, const std::optional<PoseRow>& last) {
  constexpr double rotation_slack = 1e-3;
  const auto& values = pose.values;
  std::vector<std::string> faults;
  if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); })) {
    faults.emplace_back("is not finite");
    return faults;
  }
  if (std::max({std::abs(values[0]), std::abs(values[1]), std::abs(values[2])}) >
      VoxelGrid::max_coordinate_m) {
    faults.emplace_back("is farther from the origin than any map goes");
  }
  const double norm =
      std::hypot(std::hypot(values[3], values[4]), std::hypot(values[5], values[6]));
  if (std::abs(norm - 1.0) > rotation_slack) {
    faults.push_back("has a quaternion of norm " + std::to_string(norm));
  }
  if (last && pose.stamp_ns <= last->stamp_ns) {
    faults.emplace_back("is not later than the one before");
  }
  return faults;
}

}  // namespace stillmap
