#include "clients/commands/model/benchmark_scan.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/lidar/sensor_model.hpp"

namespace stillmap::cli {
namespace {

constexpr int points_a_ring = 1900;
constexpr double height_m = 1.73;

/// Ground below the horizon, else walls 10 to 30 m away.
double range_m(double yaw, double elevation) {
  const double wall = (20.0 + 10.0 * std::sin(7.0 * yaw)) / std::cos(elevation);
  const double pole = std::fmod(std::abs(yaw), 0.35) < 0.03 ? 8.0 : wall;
  return elevation < 0.0 ? std::min(pole, height_m / std::sin(-elevation)) : pole;
}

}  // namespace

Scan benchmark_scan() {
  const SensorModel sensor = hdl_64e();
  Scan scan;
  for (int ring = 0; ring < sensor.rings; ++ring) {
    const double elevation = sensor.beam_elevation(ring);
    for (int i = 0; i < points_a_ring; ++i) {
      const double yaw = std::numbers::pi * (1.0 - 2.0 * (i + 0.5) / points_a_ring);
      const double range = range_m(yaw, elevation);
      scan.points_lidar.emplace_back(
          static_cast<float>(range * std::cos(elevation) * std::cos(yaw)),
          static_cast<float>(range * std::cos(elevation) * std::sin(yaw)),
          static_cast<float>(range * std::sin(elevation)));
      scan.intensity.push_back(0.3F);
    }
  }
  return scan;
}

}  // namespace stillmap::cli
