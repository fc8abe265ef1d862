#pragma once

#include "core/odometry/registration.hpp"

namespace stillmap {

/// A good pose of which the scan shows one shift by few residuals is degenerate where it would lie
/// as well a little to either side: then they are noise. Planes through a few points of a smooth
/// wall lean this way and that, and as many of them as stand across it look like a wall across; but
/// they are found anywhere along it. Not of the paper's own method.
[[nodiscard]] OdometryResult doubted_where_shift_fits(OdometryResult found,
                                                      const FeatureSets& features,
                                                      const LocalMap& map,
                                                      const OdometryConfig& config);

}  // namespace stillmap
