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

}  // namespace stillmap
