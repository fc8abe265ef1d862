#pragma once

#include <Eigen/Geometry>

#include "clients/terminal/json.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap::cli {

/// From the parent's x towards its y, -180 to 180.
[[nodiscard]] double heading_deg(const Eigen::Isometry3d& T_parent_child);
[[nodiscard]] double heading_deg(const PlanarPose& pose);

/// The upper three rows as one array, row by row, as KITTI writes poses.
[[nodiscard]] Json rows_json(const Eigen::Isometry3d& T);

/// An object with "position" and "orientation_xyzw".
[[nodiscard]] Json pose_json(const Eigen::Isometry3d& T);

}  // namespace stillmap::cli
