#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace stillmap {

/// One of the cells of half a degree that divide the directions round a lidar.
struct DirectionCell {
  /// In all: columns go round, rows from straight down to straight up.
  static constexpr int columns = 720;
  static constexpr int rows = 361;
  static constexpr std::size_t count = std::size_t{columns} * rows;
  static constexpr float per_rad = static_cast<float>(360.0 / std::numbers::pi);

  /// From x towards y, 0 along x; -360 to 360.
  int column = 0;
  /// 0 is straight down.
  int row = 0;

  /// The cell that a point (lidar frame) is seen in.
  [[nodiscard]] static DirectionCell of(const Eigen::Vector3f& p_lidar) {
    const float azimuth_rad = std::atan2(p_lidar.y(), p_lidar.x());
    const float elevation_rad = std::atan2(p_lidar.z(), p_lidar.head<2>().norm());
    return {static_cast<int>(std::lround(azimuth_rad * per_rad)),
            static_cast<int>(std::lround(elevation_rad * per_rad)) + rows / 2};
  }

  /// Its place among all of them, below `count`: columns go on all round, and rows beyond the last
  /// ones are those.
  [[nodiscard]] std::size_t index() const {
    const int wrapped = ((column % columns) + columns) % columns;
    return static_cast<std::size_t>(std::clamp(row, 0, rows - 1) * columns + wrapped);
  }
};

}  // namespace stillmap
