#pragma once

#include "core/odometry/odometry_config.hpp"

namespace stillmap {

/// register_features() of points that were measured at one time, as those of a submap or of a scan
/// that was straightened: no motion within the sweep is looked for.
[[nodiscard]] inline OdometryConfig rigid_registration() {
  OdometryConfig config;
  config.weighting = Weighting::geometric;
  config.registration.sweep_translation_m = 0.0;
  config.registration.max_iterations = 30;
  return config;
}

/// The same from farther off, before it: what shows the way along a smooth street is little, and
/// beyond the kernel at first.
[[nodiscard]] inline OdometryConfig wide_rigid_registration() {
  OdometryConfig config = rigid_registration();
  config.weighting = Weighting::none;
  config.registration.robust_scale_m = 0.4;
  config.registration.step_translation_m = 0.005;
  config.registration.step_rotation_rad = 0.0005;
  return config;
}

}  // namespace stillmap
