#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "core/graph/earlier_map.hpp"
#include "core/graph/submap.hpp"
#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// A round street of 314 m with houses, walls and poles on both sides; as points.
class StreetWorld {
 public:
  static constexpr double radius_m = 50.0;
  static constexpr double length_m = 314.159265;

  /// @param repeated the same houses stand again after every `repeated` m.
  explicit StreetWorld(std::uint64_t seed, double repeated_m = length_m) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    for (double way = 0.0; way < length_m; way += 0.4)
      for (double right = -14.0; right < 14.0; right += 0.4) add(way, right, 0.0);
    struct House {
      double way, width, right, height, depth;
    };
    std::vector<House> houses;
    for (double way = 0.0; way < repeated_m - 8.0; way += 9.0 + 4.0 * unit(random)) {
      for (const double side : {-1.0, 1.0}) {
        houses.push_back({way + 3.0 * unit(random), 4.0 + 4.0 * unit(random),
                          side * (7.0 + 5.0 * unit(random)), 3.0 + 4.0 * unit(random), side * 3.0});
        houses.push_back({way + 8.0 * unit(random), 0.2, side * (4.0 + unit(random)), 4.0, 0.2});
      }
    }
    for (double start = 0.0; start < length_m - 1.0; start += repeated_m)
      for (const House& house : houses)
        add_house(start + house.way, house.width, house.right, house.height, house.depth);
  }

  /// Over the street and its pavements, all the way.
  void add_roof(double height_m) {
    for (double way = 0.0; way < length_m; way += 0.4)
      for (double right = -4.0; right < 4.0; right += 0.4) add(way, right, height_m);
  }

  /// Of the lidar's beams.
  double max_elevation_rad = 1.6;

  /// Pose of a lidar on the street, forwards or backwards in the other lane.
  [[nodiscard]] Eigen::Isometry3d T_map_lidar_at(double way_m, bool backwards) const {
    const double angle = way_m / radius_m;
    const double radius = radius_m + (backwards ? -1.5 : 1.5);
    const double heading = angle + (backwards ? -0.5 : 0.5) * M_PI;
    return Eigen::Translation3d(radius * std::cos(angle), radius * std::sin(angle), 1.7) *
           Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ());
  }

  /// Every third point or so within 30 m, with noise.
  [[nodiscard]] LabelledScan scan_at(const Eigen::Isometry3d& T_map_lidar,
                                     std::uint64_t seed) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<float> noise(0.0F, 0.01F);
    const Eigen::Isometry3f T = T_map_lidar.inverse().cast<float>();
    LabelledScan scan;
    for (const Eigen::Vector3f& p_map : points_map_) {
      if (random() % 3 != 0) continue;
      const Eigen::Vector3f p = T * p_map;
      if (p.squaredNorm() > 30.0F * 30.0F) continue;
      if (std::atan2(p.z(), p.head<2>().norm()) > max_elevation_rad) continue;
      scan.scan.points_lidar.push_back(p * (1.0F + noise(random) / p.norm()));
    }
    scan.motion.assign(scan.scan.size(), Motion::stationary);
    return scan;
  }

  /// A map of a stretch, as EarlierMap reads it, in the frame of the lidar at the street's start.
  [[nodiscard]] EarlierMap::PointsNear earlier_map(double from_m, double to_m,
                                                   std::uint64_t seed) const {
    std::vector<LabelledPoint> points;
    const Eigen::Isometry3d T_map_street = T_map_lidar_at(0.0, false).inverse();
    for (double way = from_m; way < to_m; way += 10.0) {
      const Eigen::Isometry3d T_street_lidar = T_map_lidar_at(way, false);
      const Eigen::Isometry3f T = (T_map_street * T_street_lidar).cast<float>();
      for (const Eigen::Vector3f& p : scan_at(T_street_lidar, seed++).scan.points_lidar)
        points.push_back({T * p, SemanticClass::unlabeled});
    }
    return [points](const Eigen::Vector2d& position_map, double radius_m) {
      std::vector<LabelledPoint> near;
      for (const LabelledPoint& point : points) {
        const Eigen::Vector2d across = point.position_map.head<2>().cast<double>() - position_map;
        if (across.norm() <= radius_m) near.push_back(point);
      }
      return near;
    };
  }

  /// A submap of a stretch with true poses; its key is in its middle (rounded down to 2 m).
  [[nodiscard]] Submap submap_at(double from_m, double to_m, bool backwards,
                                 std::uint64_t seed) const {
    SubmapBuilder builder{SubmapConfig{}};
    for (double way = from_m; way < to_m; way += 1.0) {
      const Eigen::Isometry3d T = T_map_lidar_at(way, backwards);
      builder.add(scan_at(T, seed++), T);
    }
    const double key_m = 2.0 * std::floor(0.25 * (from_m + to_m) + 0.25);
    return builder.take(T_map_lidar_at(key_m, backwards));
  }

 private:
  void add(double way, double right, double z) {
    const double angle = way / radius_m;
    const double radius = radius_m + right;
    points_map_.emplace_back(static_cast<float>(radius * std::cos(angle)),
                             static_cast<float>(radius * std::sin(angle)), static_cast<float>(z));
  }
  void add_house(double way, double width, double right, double height, double depth) {
    for (double z = 0.0; z < height; z += 0.3) {
      for (double w = 0.0; w < width; w += 0.3) add(way + w, right, z);
      for (double d = 0.0; d < std::abs(depth); d += 0.3) {
        add(way, right + std::copysign(d, depth), z);
        add(way + width, right + std::copysign(d, depth), z);
      }
    }
  }

  std::vector<Eigen::Vector3f> points_map_;
};

}  // namespace stillmap
