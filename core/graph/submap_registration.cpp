#include "core/graph/submap_registration.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "core/frames/rigid_motion.hpp"
#include "core/odometry/rigid_registration.hpp"

namespace stillmap {
namespace {

/// So many points of a submap tell its place.
constexpr std::size_t max_registered_points = 4000;
/// What a registration errs by beside its own covariance [m, rad].
constexpr double floor_translation_m = 0.02;
constexpr double floor_rotation_rad = 0.0007;
/// Neighbouring residuals err alike: its covariance is that of so many times fewer.
constexpr double residuals_per_independent_one = 40.0;

LocalMapConfig target_map_config() {
  LocalMapConfig config;
  config.radius_m = 1000.0;
  return config;
}

FeatureSets surfaces_of(const Submap& submap) {
  FeatureSets sets;
  const std::size_t count = submap.points_submap.size();
  const std::size_t used = std::min(count, max_registered_points);
  sets.surfaces.reserve(used);
  for (std::size_t k = 0; k < used; ++k) {
    const std::size_t i = k * count / used;
    sets.surfaces.push_back({submap.points_submap[i], submap.classes[i]});
  }
  return sets;
}

}  // namespace

SubmapTarget::SubmapTarget(const Submap& submap) : map_(target_map_config()) {
  std::vector<LabelledPoint> points;
  points.reserve(submap.points_submap.size());
  for (std::size_t i = 0; i < submap.points_submap.size(); ++i)
    points.push_back({submap.points_submap[i], submap.classes[i]});
  map_.planes.insert(points);
}

OdometryResult SubmapTarget::register_submap(const Submap& source,
                                             const Eigen::Isometry3d& T_target_source_guess) const {
  const FeatureSets features = surfaces_of(source);
  const OdometryResult wide =
      register_features(features, map_, T_target_source_guess, wide_rigid_registration());
  if (wide.health == OdometryHealth::lost) return wide;
  return register_features(features, map_, wide.T_map_lidar, rigid_registration());
}

Matrix6d edge_information(const OdometryResult& registration) {
  // The covariance is along the target's axes, an edge's along those of the source.
  Matrix6d covariance =
      residuals_per_independent_one *
      turned_covariance(registration.covariance, registration.T_map_lidar.linear().transpose());
  covariance.diagonal().head<3>().array() += floor_translation_m * floor_translation_m;
  covariance.diagonal().tail<3>().array() += floor_rotation_rad * floor_rotation_rad;
  const Matrix6d information = covariance.ldlt().solve(Matrix6d::Identity());
  return 0.5 * (information + information.transpose());
}

}  // namespace stillmap
