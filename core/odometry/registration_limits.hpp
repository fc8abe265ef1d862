#pragma once

#include "core/odometry/odometry_config.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// How the features of one scan are registered.
struct RegistrationLimits : RegistrationConfig {
  /// A surface is the plane through more of its neighbours, where they make one.
  bool has_wide_planes = false;
};

/// By how the lidar of these features sees.
[[nodiscard]] RegistrationLimits limits_for(const FeatureSets& features,
                                            const RegistrationConfig& config);

}  // namespace stillmap
