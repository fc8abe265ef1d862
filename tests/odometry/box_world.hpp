#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "tests/lidar/boxes.hpp"

namespace stillmap::test {

/// A box along the axes of the map, which may move.
struct WorldBox {
  Eigen::Vector3d centre_map;
  Eigen::Vector3d size_m;
  SemanticClass label;
  /// [m/s]
  Eigen::Vector3d velocity_map = Eigen::Vector3d::Zero();
};

/// A scan of the world and which of its points are on a moving box.
struct BoxScan {
  Scan scan;
  std::vector<bool> moves;

  [[nodiscard]] PointLabels labels() const {
    return {scan.labels, std::vector<float>(scan.size(), 1.0F)};
  }
};

/// Boxes on a road, seen by a lidar whose beams are cast one by one. The lidar starts at the
/// map's origin, the road is `lidar_height_m` below.
class BoxWorld {
 public:
  static constexpr double lidar_height_m = 1.7;
  std::vector<WorldBox> boxes;
  double noise_m = 0.01;

  /// Puts a box on the road.
  void stand(double x, double y, const Eigen::Vector3d& size_m, SemanticClass label,
             const Eigen::Vector3d& velocity_map = Eigen::Vector3d::Zero()) {
    boxes.push_back({{x, y, 0.5 * size_m.z() - lidar_height_m}, size_m, label, velocity_map});
  }

  /// One point for each beam and column, in the middle of its pixel, ring after ring.
  [[nodiscard]] BoxScan scan(const SensorModel& sensor, const Eigen::Isometry3d& T_map_lidar,
                             double time_s) const {
    BoxScan result;
    result.scan.stamp_ns = std::llround(time_s * 1e9);
    std::mt19937 random(static_cast<unsigned>(result.scan.stamp_ns / 1'000'000));
    std::normal_distribution<double> noise(0.0, noise_m);
    for (int ring = 0; ring < sensor.rings; ++ring)
      for (int column = 0; column < sensor.columns; ++column) {
        const Eigen::Vector3d beam_lidar = direction(sensor, ring, column);
        const auto hit = cast(T_map_lidar.translation(), T_map_lidar.linear() * beam_lidar, time_s);
        if (!hit || hit->range_m > sensor.max_range_m) continue;
        const double range_m = hit->range_m + noise(random);
        result.scan.points_lidar.push_back((range_m * beam_lidar).cast<float>());
        result.scan.ring.push_back(static_cast<std::uint16_t>(ring));
        result.scan.labels.push_back(hit->label);
        result.moves.push_back(hit->moves);
      }
    return result;
  }

 private:
  struct Hit {
    double range_m;
    SemanticClass label;
    bool moves;
  };

  static Eigen::Vector3d direction(const SensorModel& sensor, int ring, int column) {
    const double up = sensor.beam_elevation(ring);
    const double turn = std::numbers::pi * (1.0 - 2.0 * (column + 0.5) / sensor.columns);
    return ray_at(up, turn);
  }

  [[nodiscard]] std::optional<Hit> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& beam,
                                        double time_s) const {
    std::optional<Hit> nearest;
    if (beam.z() < 0.0)
      nearest = Hit{-(origin.z() + lidar_height_m) / beam.z(), SemanticClass::road, false};
    for (const WorldBox& box : boxes) {
      const Eigen::Vector3d centre = box.centre_map + time_s * box.velocity_map - origin;
      const Eigen::Vector3d half = 0.5 * box.size_m;
      const auto range_m = range_to_box(centre - half, centre + half, beam);
      if (range_m && (!nearest || *range_m < nearest->range_m))
        nearest = Hit{*range_m, box.label, box.velocity_map.norm() > 0.0};
    }
    return nearest;
  }
};

/// A lidar small enough for tests: 32 beams from +10 to -25 degrees, a column every half degree.
inline SensorModel test_lidar() {
  SensorModel sensor;
  sensor.name = "test lidar";
  sensor.rings = 32;
  sensor.fov_up = 10.0 * std::numbers::pi / 180.0;
  sensor.fov_down = -25.0 * std::numbers::pi / 180.0;
  sensor.columns = 720;
  sensor.ring_source = RingSource::field;
  return sensor;
}

inline const Eigen::Vector3d car_size_m(4.2, 1.8, 1.5);

/// A street along x: house fronts with alleys and poles on both sides, some parked cars.
inline BoxWorld street() {
  BoxWorld world;
  for (int k = -3; k <= 7; ++k) {
    const double x = 14.0 * k;
    const double depth = 2.0 + k % 3;
    world.stand(x, 12.0, {11.0, depth, 8.0}, SemanticClass::building);
    world.stand(x + 5.0, -13.0, {9.0, depth + 1.0, 7.0}, SemanticClass::building);
    world.stand(x + 6.0, 7.5, {0.3, 0.3, 5.0}, SemanticClass::pole);
    world.stand(x, -8.0, {0.3, 0.3, 5.0}, SemanticClass::pole);
    if (k % 2 == 0) world.stand(x + 3.0, -5.5, car_size_m, SemanticClass::car);
  }
  return world;
}

}  // namespace stillmap::test
