#pragma once

#include "core/odometry/registration.hpp"

namespace stillmap {

/// Registration that finds a motion of up to 3 m, 30 m/s at 10 scans a second, from no idea of it.
/// Eq. (10) has no weight for residuals above 1 m: a robust kernel alone decides.
[[nodiscard]] OdometryConfig coarse_registration_config(OdometryConfig config);

/// An empty map for it: neighbours are found as far away as it reaches.
[[nodiscard]] LocalMap make_coarse_map();

}  // namespace stillmap
