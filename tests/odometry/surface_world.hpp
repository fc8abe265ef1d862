#pragma once

#include <Eigen/Geometry>
#include <random>
#include <span>
#include <vector>

#include "core/odometry/registration.hpp"

namespace stillmap::test {

/// A rectangle with a label: corner + s along + t across, s and t within 0..1. A narrow one is
/// sampled as an edge line.
struct Patch {
  Eigen::Vector3d corner_map;
  Eigen::Vector3d along_m;
  Eigen::Vector3d across_m;
  SemanticClass label;
};

/// Rectangles (planes) and posts (edges), sampled as the local map holds them and as a scan's
/// features see them.
class SurfaceWorld {
 public:
  std::vector<Patch> planes;
  /// Feet of upright posts of 4 m.
  std::vector<Eigen::Vector3d> posts;

  /// Map points on a grid of 0.25 m.
  [[nodiscard]] LocalMap local_map() const {
    const LocalMapConfig config;
    LocalMap map(config);
    for (const Patch& patch : planes) insert_patch(patch, map.planes);
    for (const Eigen::Vector3d& foot : posts)
      for (int k = 0; k <= 16; ++k) {
        const Eigen::Vector3d p = foot + Eigen::Vector3d(0.0, 0.0, 0.25 * k);
        map.edges.insert({{{p.cast<float>(), SemanticClass::pole}}});
      }
    return map;
  }

  /// One plane point a square metre and five edge points a post, at random, with noise.
  [[nodiscard]] FeatureSets features(const Eigen::Isometry3d& T_map_lidar, double noise_m,
                                     unsigned seed) const {
    std::mt19937 random(seed);
    FeatureSets sets;
    for (const Patch& patch : planes) sample_patch(patch, T_map_lidar, noise_m, random, sets);
    std::uniform_real_distribution<double> height(0.5, 3.5);
    for (const Eigen::Vector3d& foot : posts)
      for (int k = 0; k < 5; ++k) {
        const Eigen::Vector3d p = foot + Eigen::Vector3d(0.0, 0.0, height(random));
        sets.edges.push_back(seen(p, SemanticClass::pole, T_map_lidar, noise_m, random));
      }
    return sets;
  }

 private:
  static void insert_patch(const Patch& patch, FeatureMap& map) {
    const auto columns = static_cast<int>(patch.along_m.norm() / 0.25);
    const auto rows = static_cast<int>(patch.across_m.norm() / 0.25);
    for (int c = 0; c <= columns; ++c)
      for (int r = 0; r <= rows; ++r) {
        const Eigen::Vector3d p =
            patch.corner_map + patch.along_m * c / columns + patch.across_m * r / rows;
        map.insert({{{p.cast<float>(), patch.label}}});
      }
  }

  static void sample_patch(const Patch& patch, const Eigen::Isometry3d& T_map_lidar, double noise_m,
                           std::mt19937& random, FeatureSets& sets) {
    std::uniform_real_distribution<double> share(0.0, 1.0);
    const auto count = static_cast<int>(patch.along_m.norm() * patch.across_m.norm());
    for (int k = 0; k < count; ++k) {
      const double s = share(random);
      const double t = share(random);
      const Eigen::Vector3d p = patch.corner_map + s * patch.along_m + t * patch.across_m;
      sets.planes.push_back(seen(p, patch.label, T_map_lidar, noise_m, random));
    }
  }

  static FeaturePoint seen(const Eigen::Vector3d& p_map, SemanticClass label,
                           const Eigen::Isometry3d& T_map_lidar, double noise_m,
                           std::mt19937& random) {
    std::normal_distribution<double> noise(0.0, 1.0);
    const double dx = noise_m * noise(random);
    const double dy = noise_m * noise(random);
    const Eigen::Vector3d p = p_map + Eigen::Vector3d(dx, dy, noise_m * noise(random));
    return {(T_map_lidar.inverse() * p).cast<float>(), label};
  }
};

/// Ground and two walls along x, `length_m` long, 12 m apart.
inline SurfaceWorld corridor(double length_m) {
  const Eigen::Vector3d along(length_m, 0.0, 0.0);
  const Eigen::Vector3d up(0.0, 0.0, 5.0);
  SurfaceWorld world;
  const Eigen::Vector3d right(-0.5 * length_m, -6.0, -1.7);
  const Eigen::Vector3d left(-0.5 * length_m, 6.0, -1.7);
  world.planes = {{right, along, {0.0, 12.0, 0.0}, SemanticClass::road},
                  {right, along, up, SemanticClass::building},
                  {left, along, up, SemanticClass::building}};
  return world;
}

/// A corridor with walls at both ends and posts in it.
inline SurfaceWorld courtyard() {
  SurfaceWorld world = corridor(30.0);
  for (const double x : {-15.0, 15.0})
    world.planes.push_back(
        {{x, -6.0, -1.7}, {0.0, 12.0, 0.0}, {0.0, 0.0, 5.0}, SemanticClass::building});
  for (int k = 0; k < 8; ++k)
    world.posts.emplace_back(-13.0 + 3.7 * k, k % 2 == 0 ? 3.3 : -3.9, -1.7);
  return world;
}

}  // namespace stillmap::test
