#include "tests/server/room_scans.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/lidar/sensor_model.hpp"

namespace stillmap::test {
namespace {

constexpr double half_length_m = 25.0;
constexpr double half_width_m = 14.0;
constexpr double ground_z_m = -1.5;
constexpr double pillar_radius_m = 0.4;
constexpr std::array<std::array<double, 2>, 8> pillars = {
    {{-18, 6}, {-11, -7}, {-4, 9}, {3, -5}, {8, 7}, {13, -9}, {18, 4}, {22, -3}}};
constexpr int columns = 720;
/// The drive goes to and fro so far from the hall's middle: however long it takes, it stays inside.
constexpr double reach_m = 12.0;
constexpr double metres_a_scan = 0.15;

struct Hit {
  double range_m = std::numeric_limits<double>::infinity();
  SemanticClass label = SemanticClass::unlabeled;
};

void keep_nearer(double range_m, SemanticClass label, Hit& hit) {
  if (range_m > 0.0 && range_m < hit.range_m) hit = {range_m, label};
}

// Distance along the ray to a vertical cylinder; not positive when it misses.
double to_pillar(const Eigen::Vector2d& from, const Eigen::Vector2d& direction,
                 const std::array<double, 2>& pillar) {
  const Eigen::Vector2d offset = from - Eigen::Vector2d(pillar[0], pillar[1]);
  const double a = direction.squaredNorm();
  const double b = offset.dot(direction);
  const double discriminant =
      b * b - a * (offset.squaredNorm() - pillar_radius_m * pillar_radius_m);
  return discriminant < 0.0 ? -1.0 : (-b - std::sqrt(discriminant)) / a;
}

Hit cast(const Eigen::Vector3d& from_map, const Eigen::Vector3d& direction_map) {
  Hit hit;
  keep_nearer((ground_z_m - from_map.z()) / direction_map.z(), SemanticClass::road, hit);
  const double wall_x = std::copysign(half_length_m, direction_map.x());
  const double wall_y = std::copysign(half_width_m, direction_map.y());
  keep_nearer((wall_x - from_map.x()) / direction_map.x(), SemanticClass::building, hit);
  keep_nearer((wall_y - from_map.y()) / direction_map.y(), SemanticClass::building, hit);
  for (const auto& pillar : pillars) {
    keep_nearer(to_pillar(from_map.head<2>(), direction_map.head<2>(), pillar), SemanticClass::pole,
                hit);
  }
  return hit;
}

Eigen::Vector3d ray(double elevation, double azimuth) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

}  // namespace

StampedPose room_pose(int index) {
  return {.stamp_ns = 1'700'000'000'000'000'000 + index * std::int64_t{100'000'000},
          .T_map_lidar = Eigen::Isometry3d(
              Eigen::Translation3d(reach_m * std::sin(metres_a_scan / reach_m * index),
                                   0.3 * std::sin(0.1 * index), 0.0) *
              Eigen::AngleAxisd(0.01 * index, Eigen::Vector3d::UnitZ()))};
}

Scan room_scan(int index) { return seen_in_room(room_pose(index)); }

Scan seen_in_room(const StampedPose& pose) {
  const SensorModel sensor = vlp_16();
  Scan scan;
  scan.stamp_ns = pose.stamp_ns;
  for (int ring = 0; ring < sensor.rings; ++ring) {
    const double share = static_cast<double>(ring) / (sensor.rings - 1);
    const double elevation = sensor.fov_up + share * (sensor.fov_down - sensor.fov_up);
    for (int column = 0; column < columns; ++column) {
      const double azimuth = 2.0 * std::numbers::pi * (column + 0.5) / columns;
      const Eigen::Vector3d direction_lidar = ray(elevation, azimuth);
      const Hit hit =
          cast(pose.T_map_lidar.translation(), pose.T_map_lidar.rotation() * direction_lidar);
      scan.points_lidar.push_back((hit.range_m * direction_lidar).cast<float>());
      scan.intensity.push_back(100.0F);
      scan.ring.push_back(static_cast<std::uint16_t>(ring));
      scan.labels.push_back(hit.label);
    }
  }
  return scan;
}

}  // namespace stillmap::test
