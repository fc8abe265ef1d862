#pragma once

#include <vector>

#include "tests/odometry/box_world.hpp"

namespace stillmap::test {

/// A lidar that winds along x at 6 m/s, ten scans a second, from the origin.
struct BoxSequence {
  std::vector<Eigen::Isometry3d> T_map_lidar;
  std::vector<BoxScan> scans;

  BoxSequence(const BoxWorld& world, int count) {
    for (int k = 0; k < count; ++k) {
      T_map_lidar.push_back(T_map_lidar_at(k));
      scans.push_back(world.scan(test_lidar(), T_map_lidar.back(), 0.1 * k));
    }
  }

  /// Also between scans.
  [[nodiscard]] static Eigen::Isometry3d T_map_lidar_at(double scan) {
    const double x = 0.6 * scan;
    const double y = 1.0 - std::cos(x / 8.0);
    const double heading = std::atan(std::sin(x / 8.0) / 8.0);
    return Eigen::Translation3d(x, y, 0.0) * Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ());
  }
};

/// The street with a car that drives ahead, two that come towards the lidar and one that overtakes.
inline BoxWorld street_with_traffic() {
  BoxWorld world = street();
  world.stand(9.0, 1.0, car_size_m, SemanticClass::car, {7.0, 0.0, 0.0});
  world.stand(30.0, 5.0, car_size_m, SemanticClass::car, {-8.0, 0.0, 0.0});
  world.stand(60.0, 5.0, car_size_m, SemanticClass::car, {-8.0, 0.0, 0.0});
  world.stand(-12.0, -2.8, car_size_m, SemanticClass::car, {11.0, 0.0, 0.0});
  return world;
}

}  // namespace stillmap::test
