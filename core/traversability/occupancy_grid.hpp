#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Part of the map from above. `contains`, where given, takes cells out whose centre (map frame
/// [m]) it refuses.
struct AreaRegion {
  /// Map frame [m]; infinite faces end at the map's edge.
  Eigen::AlignedBox2d box_map;
  std::function<bool(const Eigen::Vector2d&)> contains;
};

/// The whole map.
[[nodiscard]] AreaRegion everywhere();

/// A grid as nav_msgs/OccupancyGrid has it: row after row from the lowest y, -1 unknown, 0 free
/// and wanted, 1..98 free at a cost, 99 too near to something lethal, 100 lethal.
struct OccupancyGrid {
  AreaStatus status = AreaStatus::ok;
  std::string reason;
  /// Lowest corner of the first cell, map frame [m].
  Eigen::Vector2d origin_map = Eigen::Vector2d::Zero();
  double resolution_m = 0.0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::int8_t> data;
  std::uint64_t map_version = 0;

  [[nodiscard]] std::int8_t at(std::uint32_t x, std::uint32_t y) const {
    return data[static_cast<std::size_t>(y) * width + x];
  }
};

inline constexpr std::int8_t occupancy_unknown = -1;
inline constexpr std::int8_t occupancy_inflated = 99;
inline constexpr std::int8_t occupancy_lethal = 100;

/// Largest grid [cells].
inline constexpr std::uint64_t max_grid_cells = 100'000'000;

/// The cells of a region. A box that is empty or has NaN is an invalid request, one outside the
/// map is not found.
[[nodiscard]] OccupancyGrid occupancy_grid(const TraversabilityView& view,
                                           const AreaRegion& region);

}  // namespace stillmap
