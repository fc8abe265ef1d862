#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "core/graph/submap_match.hpp"

namespace stillmap {

/// Clear height under the ceiling over the ground of `lower`, where `upper` has seen something,
/// too, when that lies at this place of the plan [m]. Nothing under the sky and under branches: a
/// ceiling is as high above the ground all over, and hides what is above it.
[[nodiscard]] std::optional<double> ceiling_height_m(const PlacedSubmap& lower,
                                                     const PlacedSubmap& upper,
                                                     const Eigen::Isometry2d& T_upper_lower);

/// Whether a ceiling of `other` is over the way of `driver`, put there like this, which does not
/// show it, though it shows higher things not far away: it was driven on another level, on top of
/// it maybe. Both as they were seen, whatever their height.
[[nodiscard]] bool lacks_ceiling(const Submap& driver, const Submap& other,
                                 const Eigen::Isometry3d& T_other_driver);

}  // namespace stillmap
