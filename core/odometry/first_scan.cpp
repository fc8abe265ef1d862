#include "core/odometry/first_scan.hpp"

#include "core/odometry/registration.hpp"
#include "core/odometry/scan_features.hpp"

namespace stillmap {

bool can_begin_map(const FeatureSets& features, const OdometryConfig& config) {
  const auto needed = static_cast<std::size_t>(config.registration.min_correspondences);
  return features.edges.size() + features.planes.size() + features.surfaces.size() >= needed;
}

void straighten_first_scan(const FirstScan& first, const FeatureSets& features, double interval_s,
                           const SweepTimes& sweep, const OdometryConfig& config, LocalMap& map,
                           RegisteredScan& last, OdometryResult& second) {
  constexpr int rounds = 4;
  const LocalMap map_before = map;
  const Eigen::Isometry3d T_map_lidar_before = last.T_map_lidar;
  OdometryResult found = second;
  FeatureSets moving = features;
  for (int round = 0; round < rounds; ++round) {
    const PoseTangent velocity =
        twist_of(last.T_map_lidar.inverse() * found.T_map_lidar) / interval_s;
    last.T_map_lidar = first.T_map_stamp * motion_of(velocity * first.sweep.middle_s);
    map.clear();
    extend_local_map(map, first.features, last.T_map_lidar, velocity * first.sweep.duration_s);
    moving.sweep_prior.T_map_lidar_last = last.T_map_lidar;
    found = register_features(moving, map, last.T_map_lidar * motion_of(velocity * interval_s),
                              config, velocity * sweep.duration_s);
    if (found.health != OdometryHealth::lost) continue;
    map = map_before;
    last.T_map_lidar = T_map_lidar_before;
    return;
  }
  second = found;
}

}  // namespace stillmap
