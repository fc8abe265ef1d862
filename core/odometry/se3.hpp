#pragma once

#include <Eigen/Geometry>

namespace stillmap {

/// Tangent of a pose: (translation [m], rotation [rad]), both along the axes of the map frame, the
/// rotation about the lidar's centre. This is also the order and meaning of a ROS pose covariance.
using PoseTangent = Eigen::Matrix<double, 6, 1>;

/// [v]x: skew(v) * w = v x w.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Rotation by |omega| about omega (Rodrigues).
[[nodiscard]] Eigen::Matrix3d so3_exp(const Eigen::Vector3d& omega);

/// Inverse of so3_exp, |omega| <= pi.
[[nodiscard]] Eigen::Vector3d so3_log(const Eigen::Matrix3d& rotation);

/// T moved by xi: translation t + xi_t, rotation exp(xi_r) R. The derivative of T p by xi at 0 is
/// [ I | -[R p]x ].
[[nodiscard]] Eigen::Isometry3d boxplus(const Eigen::Isometry3d& T, const PoseTangent& xi);

/// The xi with boxplus(a, xi) = b.
[[nodiscard]] PoseTangent boxminus(const Eigen::Isometry3d& b, const Eigen::Isometry3d& a);

/// Twist of the screw motion T: its rotation vector, and the translation that exp() takes back to
/// T's.
[[nodiscard]] PoseTangent twist_of(const Eigen::Isometry3d& T);

/// Inverse of twist_of.
[[nodiscard]] Eigen::Isometry3d motion_of(const PoseTangent& twist);

/// The share `s` of the motion T: s = 0 is none, 1 is T, larger extrapolates.
[[nodiscard]] Eigen::Isometry3d scaled_motion(const Eigen::Isometry3d& T, double s);

}  // namespace stillmap
