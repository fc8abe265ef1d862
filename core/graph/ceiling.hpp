#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "core/graph/submap_match.hpp"

namespace stillmap {

/// Clear height under the ceiling over the ground of `lower`, where `upper` has seen something,
/// too, when that lies at this place of the plan [m]. Nothing under the sky and under branches: a
/// ceiling is as high above the ground all over, and hides what is above it.
[[nodiscard]] std::optional<double> ceiling_height_m(const PlacedSubmap& lower,
                                                     const PlacedSubmap& upper,
                                                     const Eigen::Isometry2d& T_upper_lower);

/// Whether a ceiling of `other` is over the way of `driver`, put there like this, which does not
/// show it, though its lidar looks up so steeply that it must have seen it: it was driven on
/// another level, on top of it maybe. Both as they were seen, whatever their height.
[[nodiscard]] bool lacks_ceiling(const Submap& driver, const Submap& other,
                                 const Eigen::Isometry3d& T_other_driver);

/// Whether a lidar that came along `own_way` would have seen a level over `other_way` that is
/// `height_m` higher, and saw none: beams that rise met walls and trees beside its way, and next to
/// nothing over the other. Places of the lidars, in the submap's frame [m].
[[nodiscard]] bool is_open_above(const Submap& submap, std::span<const Eigen::Vector3d> own_way,
                                 std::span<const Eigen::Vector3d> other_way, double height_m);

}  // namespace stillmap
