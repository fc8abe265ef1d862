#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/map/query/map_query.hpp"

namespace stillmap {

/// The highest voxel of every cell in plan, rows from the greatest y downwards, as pictures have
/// them.
struct TopView {
  int columns = 0;
  int rows = 0;
  /// Map position of the upper left corner of the first cell [m].
  Eigen::Vector2d corner_map = Eigen::Vector2d::Zero();
  double cell_size_m = 0.0;
  /// `nothing` where the map has no voxel.
  std::vector<std::uint8_t> label;
  /// Mean height of the voxel's points, map frame [m]; `no_height` where there is none.
  std::vector<float> height_m;

  static constexpr std::uint8_t nothing = 255;
  static constexpr float no_height = -9999.0F;
  /// Of a map of 2.8 km by 2.8 km in 20 cm voxels; larger ones are to be cut by region.
  static constexpr std::int64_t max_cells = 200'000'000;
};

/// Cells lie on multiples of `cell_size_m` (above 0). Throws std::invalid_argument for no voxels,
/// or too many cells.
[[nodiscard]] TopView rasterize_top_view(std::span<const QueryVoxel> voxels, double cell_size_m);

}  // namespace stillmap
