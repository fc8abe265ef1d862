#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>

#include "core/lidar/scan.hpp"
#include "core/lidar/shared_trajectory.hpp"
#include "core/localization/place_index.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/static_map.hpp"

namespace stillmap::test {

/// Off the axes, for rays that miss no plane.
inline Eigen::Isometry3d pose_off_axes(double x, double y, double height_m, double heading_rad) {
  return Eigen::Translation3d(x, y, height_m) *
         Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(0.003, Eigen::Vector3d::UnitX());
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
