#pragma once

#include <Eigen/Geometry>

namespace stillmap {

/// T_parent_child of a child whose origin lies at `translation_m`, turned by roll, then pitch, then
/// yaw about the parent's fixed axes [rad], as URDF and tf2 have it.
[[nodiscard]] Eigen::Isometry3d from_xyz_rpy(const Eigen::Vector3d& translation_m,
                                             const Eigen::Vector3d& roll_pitch_yaw);

/// Where the child's x axis points, seen from above: from the parent's x towards its y [rad].
[[nodiscard]] double heading_rad(const Eigen::Isometry3d& T_parent_child);

/// R_level_body: the least turn that has `up_body`, a unit vector, point along z.
[[nodiscard]] Eigen::Matrix3d levelling_rotation(const Eigen::Vector3d& up_body);

/// The same motion of a rigid body as seen by another frame on it: `T_b_before_after` of frame b
/// as that of frame a.
[[nodiscard]] Eigen::Isometry3d motion_of_frame(const Eigen::Isometry3d& T_a_b,
                                                const Eigen::Isometry3d& T_b_before_after);

/// Covariance of (translation, rotation) in the map frame, as OdometryResult has it, of frame b on
/// the same rigid body as frame a, whose covariance it is.
[[nodiscard]] Eigen::Matrix<double, 6, 6> covariance_of_frame(
    const Eigen::Matrix<double, 6, 6>& covariance_a, const Eigen::Isometry3d& T_map_a,
    const Eigen::Isometry3d& T_a_b);

/// A covariance of (translation, rotation), or its inverse, along the axes of frame b, along those
/// of frame a.
[[nodiscard]] Eigen::Matrix<double, 6, 6> turned_covariance(
    const Eigen::Matrix<double, 6, 6>& covariance_b, const Eigen::Matrix3d& R_a_b);

}  // namespace stillmap
