#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "core/odometry/feature_map.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {

/// The edge line or plane that a feature point should lie on. Both are the set of points x with
/// `projector * (x - centre_map) = 0`: projector = I - u u' for a line along u, n n' for a plane
/// with normal n, so that the distances (8) and (12) are |projector * (x - centre_map)|.
struct FittedSurface {
  Eigen::Vector3d centre_map;
  Eigen::Matrix3d projector;
};

/// Line through neighbours by PCA, eq. (5)-(7) with the ordinary covariance (as printed, eq. 6 is
/// identically zero). Nothing unless one eigenvalue stands out.
[[nodiscard]] std::optional<FittedSurface> fit_line(const Neighbours& neighbours);

/// Plane through neighbours by PCA, eq. (11). Nothing unless they are flat, and spread in two
/// directions.
[[nodiscard]] std::optional<FittedSurface> fit_plane(const Neighbours& neighbours);

/// The plane where there is one, else the line.
[[nodiscard]] std::optional<FittedSurface> fit_surface(const Neighbours& neighbours);

/// c of eq. (9): the share of neighbours with another class than `label`. 0 when `label` or all
/// neighbours are unlabeled, since no label contradicts nothing.
[[nodiscard]] double semantic_inconsistency(const Neighbours& neighbours, SemanticClass label);

/// w of eq. (10) in the mode's form, 0..1. `distance_m` is within [0, 1]; the residual's unit is
/// the metre, as the paper means it.
[[nodiscard]] double weight(Weighting weighting, double alpha, double distance_m,
                            double inconsistency);

/// Residual of a point against its surface and what the normal equations need of it.
struct Residual {
  /// projector * (T p - centre) [m]; its norm is d of eq. (8) or (12).
  Eigen::Vector3d vector;
  /// Derivative of `vector` by the pose tangent (boxplus).
  Eigen::Matrix<double, 3, 6> jacobian;
};

[[nodiscard]] Residual residual(const Eigen::Vector3d& point_lidar,
                                const Eigen::Isometry3d& T_map_lidar, const FittedSurface& surface);

}  // namespace stillmap
