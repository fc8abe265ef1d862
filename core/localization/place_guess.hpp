#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "core/localization/place_search.hpp"

namespace stillmap {

/// Where somebody says that what carries the lidar is: on the map's ground, so that x, y and
/// heading of the pose count.
struct PlaceGuess {
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
  /// It is so far from there at most [m], and turned by so much [rad].
  double radius_m = 0.0;
  double max_turn_rad = std::numbers::pi;

  /// Where the lidar is looked for.
  [[nodiscard]] SearchRegion region(const Eigen::Isometry3d& T_base_lidar) const {
    return {.centre_map = (T_map_base * T_base_lidar).translation().head<2>(),
            .radius_m = radius_m,
            .heading_rad = std::atan2(T_map_base.linear()(1, 0), T_map_base.linear()(0, 0)),
            .max_turn_rad = max_turn_rad};
  }
};

}  // namespace stillmap
