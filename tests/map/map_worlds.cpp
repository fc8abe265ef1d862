#include "tests/map/map_worlds.hpp"

#include <cmath>
#include <numbers>
#include <random>

namespace stillmap::test {
namespace {

struct Hit {
  double range_m;
  SemanticClass label;
};

constexpr double lidar_height_m = 1.73;

/// Distance along a ray in plan to the nearest wall of a street that runs along x.
double wall_distance(double azimuth, double lateral_m) {
  return lateral_m / std::max(std::abs(std::sin(azimuth)), 1e-3);
}

Hit cast(double azimuth, double elevation) {
  const double forward = std::cos(elevation);
  // Bays along the front: its depth changes every 6 m.
  const double along_m = wall_distance(azimuth, 12.0) * std::cos(azimuth);
  const double front_m = 12.0 + 1.5 * (std::sin(along_m * std::numbers::pi / 6.0) > 0.0);
  Hit hit{wall_distance(azimuth, front_m) / forward, SemanticClass::building};
  if (std::fmod(std::abs(azimuth), 0.31) < 0.02) hit = {9.0 / forward, SemanticClass::pole};
  if (elevation < 0.0) {
    const double ground_m = lidar_height_m / -std::sin(elevation);
    const bool on_road = ground_m * forward * std::abs(std::sin(azimuth)) < 5.0;
    if (ground_m < hit.range_m) {
      hit = {ground_m, on_road ? SemanticClass::road : SemanticClass::sidewalk};
    }
  }
  return hit;
}

}  // namespace

LabelledScan street_scan(std::uint32_t seed, int columns) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise_m(0.0, 0.02);
  LabelledScan scan;
  scan.scan.stamp_ns = std::int64_t{seed} * 100'000'000;
  for (int ring = 0; ring < 64; ++ring) {
    const double elevation = (2.0 - 26.8 * ring / 63.0) * std::numbers::pi / 180.0;
    for (int column = 0; column < columns; ++column) {
      const double azimuth = std::numbers::pi * (1.0 - 2.0 * column / columns);
      const Hit hit = cast(azimuth, elevation);
      const double range_m = hit.range_m + noise_m(random);
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      add_point(scan, (range_m * ray).cast<float>(), hit.label);
    }
  }
  return scan;
}

StaticMap street_map(int scans, int columns) {
  StaticMap map{StaticMapConfig{.min_points = 2}};
  for (int i = 0; i < scans; ++i) {
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(i, 0.0, lidar_height_m));
    map.insert(street_scan(static_cast<std::uint32_t>(i), columns), T_map_lidar);
  }
  return map;
}

}  // namespace stillmap::test
