#include "core/odometry/ring_start.hpp"

#include <utility>

#include "core/odometry/prior_map.hpp"
#include "core/odometry/scan_features.hpp"

namespace stillmap {
namespace {

/// Scans from so many positions, so far apart [m], show what lies between the rings of one.
constexpr std::size_t enough_scans = 10;
constexpr double min_distance_m = 0.3;
/// Of a start that stays in doubt, the last ones are kept.
constexpr std::size_t max_scans = 30;

}  // namespace

void RingStart::add(FeatureSets registered, FeatureSets mapped,
                    const Eigen::Isometry3d& T_map_lidar) {
  const auto distance_m = [&](const RingScan& scan) {
    return (scan.T_map_lidar.translation() - T_map_lidar.translation()).norm();
  };
  if (!scans_.empty() && distance_m(scans_.back()) < min_distance_m) return;
  scans_.push_back({std::move(registered), std::move(mapped), T_map_lidar});
  if (scans_.size() > max_scans) scans_.pop_front();
}

void RingStart::set_prior_map(std::span<const LabelledPoint> points_map) {
  prior_points_map_.assign(points_map.begin(), points_map.end());
}

bool RingStart::is_complete() const { return scans_.size() >= enough_scans; }

RingStart::BySurfaces RingStart::by_surfaces(const OdometryConfig& config) const {
  OdometryConfig in_place = config;
  in_place.registration.max_iterations = 1;
  BySurfaces result{LocalMap(config.local_map), FitStatistics()};
  insert_prior_map(prior_points_map_, result.map);
  for (const RingScan& scan : scans_) {
    if (&scan != &scans_.front() || !prior_points_map_.empty())
      result.fits.add(register_features(scan.registered, result.map, scan.T_map_lidar, in_place));
    extend_local_map(result.map, scan.mapped, scan.T_map_lidar);
  }
  return result;
}

}  // namespace stillmap
