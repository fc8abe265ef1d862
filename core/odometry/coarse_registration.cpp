#include "core/odometry/coarse_registration.hpp"

namespace stillmap {
namespace {

constexpr double reach_m = 3.0;

}  // namespace

OdometryConfig coarse_registration_config(OdometryConfig config) {
  config.weighting = Weighting::none;
  config.registration.robust_scale_m = 0.5;
  config.registration.max_neighbour_distance_m = reach_m;
  config.registration.max_residual_m = reach_m;
  config.registration.max_iterations = 50;
  config.registration.step_translation_m = 0.01;
  config.registration.step_rotation_rad = 0.001;
  return config;
}

LocalMap make_coarse_map() {
  const LocalMapConfig config{
      .voxel_size_m = reach_m, .max_points_per_voxel = 32, .min_spacing_m = 0.5};
  return {FeatureMap(config), FeatureMap(config)};
}

}  // namespace stillmap
