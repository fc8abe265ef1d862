#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace stillmap::test {

/// How far along `ray` from the origin the box between the corners is entered, in lengths of `ray`;
/// nothing where it is missed, or the origin lies in it. No part of `ray` may be zero.
[[nodiscard]] inline std::optional<double> range_to_box(const Eigen::Vector3d& low,
                                                        const Eigen::Vector3d& high,
                                                        const Eigen::Vector3d& ray) {
  double enter = 0.0;
  double leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = low[axis] / ray[axis];
    const double b = high[axis] / ray[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  if (enter > leave || enter <= 0.0) return std::nullopt;
  return enter;
}

/// The ray of length 1 at these angles [rad]: x at both zero, y at a quarter turn to the left.
[[nodiscard]] inline Eigen::Vector3d ray_at(double elevation, double azimuth) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

/// Boxes along the axes of the map, seen along rays that are cast one by one.
class Boxes {
 public:
  void add(const Eigen::Vector3d& low_map, const Eigen::Vector3d& high_map) {
    boxes_.push_back({low_map, high_map});
  }
  /// To the nearest that the ray of length 1 hits [m]; infinite where it hits none.
  [[nodiscard]] double range_m(const Eigen::Vector3d& from_map,
                               const Eigen::Vector3d& ray_map) const {
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const Box& box : boxes_) {
      const auto range_m = range_to_box(box.low - from_map, box.high - from_map, ray_map);
      if (range_m) nearest_m = std::min(nearest_m, *range_m);
    }
    return nearest_m;
  }

 private:
  struct Box {
    Eigen::Vector3d low, high;
  };
  std::vector<Box> boxes_;
};

}  // namespace stillmap::test
