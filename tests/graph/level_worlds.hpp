#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "tests/lidar/boxes.hpp"

// Made streets that lead over one another, and car parks.

namespace stillmap::levels {

constexpr double lidar_height_m = 1.8;
constexpr double max_range_m = 60.0;

/// Boxes that a lidar of 24 rings sees.
class BoxWorld : public test::Boxes {
 public:
  double highest_beam_deg = 15.0;
  double span_deg = 40.0;

  [[nodiscard]] LabelledScan scan_at(const Eigen::Isometry3d& T_map_lidar,
                                     std::uint64_t seed) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise_m(0.0, 0.01);
    LabelledScan scan;
    for (int ring = 0; ring < 24; ++ring) {
      const double elevation = (highest_beam_deg - span_deg * ring / 23.0) * rad_per_deg;
      for (int k = 0; k < 360; ++k) {
        const Eigen::Vector3d ray = test::ray_at(elevation, k * rad_per_deg);
        const double hit_m = range_m(T_map_lidar.translation(), T_map_lidar.linear() * ray);
        if (hit_m > max_range_m) continue;
        scan.scan.points_lidar.push_back(((hit_m + noise_m(random)) * ray).cast<float>());
      }
    }
    scan.motion.assign(scan.scan.size(), Motion::stationary);
    return scan;
  }
};

/// Two poses a metre apart, along a straight way that may climb.
inline void drive(std::vector<Eigen::Isometry3d>& poses, const Eigen::Vector3d& from,
                  const Eigen::Vector3d& to) {
  const Eigen::Vector3d way = to - from;
  const int steps = static_cast<int>(way.norm());
  const Eigen::AngleAxisd heading(std::atan2(way.y(), way.x()) + 0.003, Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd pitch(-std::atan2(way.z(), way.head<2>().norm()),
                                Eigen::Vector3d::UnitY());
  for (int k = 0; k <= steps; ++k)
    poses.push_back(
        Eigen::Translation3d(from + way * k / steps + Eigen::Vector3d(0.01, 0.01, lidar_height_m)) *
        heading * pitch);
}

/// A street along x, and one along y that leads over it by a bridge.
inline BoxWorld bridge_world(std::uint64_t seed, double deck_m) {
  BoxWorld world;
  world.add({-150, -150, -1}, {150, 150, 0});
  // Ramps in steps of a metre, and the deck.
  for (int y = -70; y < 70; ++y) {
    const double away_m = std::max(0.0, std::abs(y + 0.5) - 14.0);
    const double top_m = deck_m - 0.07 * away_m;
    if (top_m < 0.05) continue;
    const double y0 = y;
    world.add({-5.0, y0, top_m - 0.8}, {5.0, y0 + 1.0, top_m});
    for (const double x : {-5.0, 4.8}) world.add({x, y0, top_m}, {x + 0.2, y0 + 1.0, top_m + 0.9});
    if (top_m < 2.5) world.add({-5.0, y0, 0}, {5.0, y0 + 1.0, top_m - 0.8});
  }
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  // Houses along both, but for the crossing.
  for (const double side : {-1.0, 1.0}) {
    for (const double end : {-1.0, 1.0}) {
      for (double w = 15.0; w < 90.0;) {
        const double width_m = 9.0 + 12.0 * share(random);
        const double face_m = 11.0 + 2.0 * share(random);
        const double high_m = 9.0 + 8.0 * share(random);
        const auto box = [&](bool along_x) {
          const Eigen::Vector2d a(end * w, side * face_m);
          const Eigen::Vector2d b(end * (w + width_m - 1.0), side * (face_m + 8.0));
          Eigen::Vector2d low = a.cwiseMin(b);
          Eigen::Vector2d high = a.cwiseMax(b);
          if (!along_x) std::swap(low.x(), low.y()), std::swap(high.x(), high.y());
          world.add({low.x(), low.y(), 0}, {high.x(), high.y(), high_m});
        };
        if (w > 24.0 || face_m < 24.0) box(true), box(false);
        w += width_m;
      }
    }
  }
  return world;
}

/// A street of houses along x, 60 m of it under a viaduct that is as long.
inline BoxWorld viaduct_world(std::uint64_t seed, double deck_m) {
  BoxWorld world;
  world.add({-150, -150, -1}, {150, 150, 0});
  world.add({-35, -4.5, deck_m - 0.8}, {35, 4.5, deck_m});
  for (const double y : {-4.5, 4.3}) world.add({-35, y, deck_m}, {35, y + 0.2, deck_m + 0.9});
  for (const double x : {-35.0, -12.0, 12.0, 34.0})
    for (const double y : {-4.5, 3.9}) world.add({x, y, 0}, {x + 0.6, y + 0.6, deck_m - 0.8});
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  for (const double side : {-1.0, 1.0}) {
    for (double x = -90.0; x < 90.0;) {
      const double width_m = 5.0 + 8.0 * share(random);
      const double near_m = side * (7.0 + share(random));
      const double far_m = near_m + side * 6.0;
      const double high_m = deck_m + 8.0 + 6.0 * share(random);
      world.add({x, std::min(near_m, far_m), 0}, {x + width_m, std::max(near_m, far_m), high_m});
      x += width_m + 1.0 + 2.0 * share(random);
    }
  }
  return world;
}

/// A stretch so far away that odometry may have drifted by a level until the lidar comes back.
inline void drive_away(std::vector<Eigen::Isometry3d>& poses, double there_m) {
  poses.push_back(Eigen::Translation3d(0, there_m, 0) * Eigen::Isometry3d::Identity());
}

/// Storeys of the same walls, pillars and stairs, with other cars on each; houses round them.
inline BoxWorld car_park(std::uint64_t seed, int storeys, double length_m = 60.0) {
  BoxWorld world;
  const double width_m = 34.0, storey_m = 3.0;
  world.add({-60, -60, -1}, {length_m + 60.0, 90, -0.3});
  for (int s = 0; s <= storeys; ++s) {
    const double z = s * storey_m;
    world.add({0, 0, z - 0.3}, {length_m, width_m, z});
    if (s == storeys) break;
    world.add({-0.2, 0, z}, {0, width_m, z + 1.1});
    world.add({length_m, 0, z}, {length_m + 0.2, width_m, z + 1.1});
    world.add({0, -0.2, z}, {length_m, 0, z + 1.1});
    world.add({0, width_m, z}, {length_m, width_m + 0.2, z + 1.1});
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(s));
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (int k = 0; k < 24; ++k) {
      const double x = 2.0 + share(random) * (length_m - 8.0);
      const double y = k % 3 == 0   ? 0.4 + share(random)
                       : k % 3 == 1 ? width_m - 2.5 + share(random)
                                    : 15.0 + 2.0 * share(random);
      world.add({x, y, z}, {x + 4.2, y + 1.7, z + 1.5});
    }
  }
  for (double x = 7.0; x < length_m; x += 10.0)
    for (const double y : {11.0, 23.0})
      world.add({x, y, 0}, {x + 0.4, y + 0.4, storeys * storey_m});
  world.add({28, 12, 0}, {34, 16, storeys * storey_m});
  // Houses around, seen over the parapets.
  world.add({-25, -12, 0}, {-14, 9, 12});
  world.add({8, -26, 0}, {20, -14, 14});
  world.add({29, -23, 0}, {44, -15, 16});
  world.add({length_m + 14.0, 2, 0}, {length_m + 22.0, 21, 15});
  world.add({3, 47, 0}, {16, 58, 13});
  world.add({26, 44, 0}, {41, 50, 16});
  return world;
}

inline void drive_round(std::vector<Eigen::Isometry3d>& poses, double z) {
  drive(poses, {6, 7, z}, {54, 7, z});
  drive(poses, {54, 8, z}, {54, 27, z});
  drive(poses, {53, 27, z}, {6, 27, z});
  drive(poses, {6, 26, z}, {6, 8, z});
}

}  // namespace stillmap::levels
