#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/shared_trajectory.hpp"
#include "core/localization/place_index.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/static_map.hpp"
#include "tests/lidar/boxes.hpp"

namespace stillmap::test {

/// Off the axes, for rays that miss no plane.
inline Eigen::Isometry3d pose_off_axes(double x, double y, double height_m, double heading_rad) {
  return Eigen::Translation3d(x, y, height_m) *
         Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(0.003, Eigen::Vector3d::UnitX());
}

/// What 32 rings a degree apart, from 15 degrees up to 16 down, see of boxes: so many rays a turn,
/// with noise of 1.5 cm, none longer than `max_range_m`. One stamp gives one scan.
inline Scan scan_of(const Boxes& boxes, const Eigen::Isometry3d& T_map_lidar, std::int64_t stamp_ns,
                    int columns, double max_range_m) {
  std::mt19937_64 random(static_cast<std::uint64_t>(stamp_ns));
  std::normal_distribution<double> noise_m(0.0, 0.015);
  Scan scan;
  scan.stamp_ns = stamp_ns;
  for (int ring = 0; ring < 32; ++ring) {
    for (int k = 0; k < columns; ++k) {
      const Eigen::Vector3d ray =
          ray_at((15.0 - ring) * rad_per_deg, k * 360.0 / columns * rad_per_deg);
      const double hit_m = boxes.range_m(T_map_lidar.translation(), T_map_lidar.linear() * ray);
      if (hit_m > max_range_m) continue;
      scan.points_lidar.push_back(((hit_m + noise_m(random)) * ray).cast<float>());
      scan.ring.push_back(static_cast<std::uint16_t>(ring));
    }
  }
  return scan;
}

/// The map of a drive of so many scans, ten a second, all of what stands still.
inline std::shared_ptr<const PlaceIndex> index_of_drive(
    int scans, const std::function<Eigen::Isometry3d(int)>& pose_map,
    const std::function<Scan(const Eigen::Isometry3d&, std::int64_t)>& scan_at) {
  StaticMap map{StaticMapConfig{}};
  map.reset(1);
  SharedTrajectory path;
  for (int k = 0; k < scans; ++k) {
    LabelledScan scan;
    const Eigen::Isometry3d T_map_lidar = pose_map(k);
    const std::int64_t stamp_ns = (k + 1) * 100'000'000LL;
    scan.scan = scan_at(T_map_lidar, stamp_ns);
    scan.motion.assign(scan.scan.size(), Motion::stationary);
    map.insert(scan, T_map_lidar);
    path.push_back({stamp_ns, T_map_lidar});
  }
  return std::make_shared<const PlaceIndex>(map.view(), path,
                                            std::make_shared<TileReader>(nullptr));
}

}  // namespace stillmap::test
