#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>

#include "core/odometry/feature_map.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {

/// The edge line or plane that a feature point should lie on: the set of points x with
/// n . (x - centre_map) = 0 for its normal, or for both normals of a line, which are at right
/// angles to it and to each other. The distances (8) and (12) are the norm of these products.
struct FittedSurface {
  Eigen::Vector3d centre_map;
  std::array<Eigen::Vector3d, 2> normals;
  /// 1 for a plane, 2 for a line.
  std::size_t normal_count = 1;
  /// What the distance along each normal counts, 0..1, beside the weight of eq. (10).
  std::array<double, 2> weights{1.0, 1.0};
  /// Of a plane: variance of its neighbours across it [m^2].
  double variance_m2 = 0.0;
};

/// Line through neighbours by PCA, eq. (5)-(7) with the ordinary covariance (as printed, eq. 6 is
/// identically zero). Nothing unless one eigenvalue stands out.
[[nodiscard]] std::optional<FittedSurface> fit_line(const Neighbours& neighbours);

/// Plane through neighbours by PCA, eq. (11). Nothing unless they are flat, and spread in two
/// directions: across by a share of `min_width` of that along, as variances.
[[nodiscard]] std::optional<FittedSurface> fit_plane(
    const Neighbours& neighbours, double min_width = RegistrationConfig{}.min_plane_width);

/// The plane where there is one, else the line.
[[nodiscard]] std::optional<FittedSurface> fit_surface(
    const Neighbours& neighbours, double min_plane_width = RegistrationConfig{}.min_plane_width);

/// The plane through all neighbours where there is one, else the surface through the nearest `few`,
/// which alone `neighbours` then holds.
[[nodiscard]] std::optional<FittedSurface> fit_wide_surface(Neighbours& neighbours, int few,
                                                            double min_plane_width);

/// The surface as the scan sees it, whose smooth ring runs along `tangent_map` there (length 1, or
/// zero: not known, and the surface stays as it is). A line across it is one column of a smooth
/// wall and becomes the plane through both; a plane that leans over the tangent is turned to
/// contain it. Nothing where the plane stands across the ring. On long smooth walls the points far
/// ahead lie in columns farther apart than their neighbours, which go wherever the lidar goes.
[[nodiscard]] std::optional<FittedSurface> surface_along(const FittedSurface& surface,
                                                         const Eigen::Vector3d& tangent_map);

/// What the distances from a line along the lidar's rings count, 0..1.
struct RingLineWeights {
  double along_ray = 1.0;
  double across_rings = 1.0;
};

/// A line as a lidar sees it that turns about its z axis, from a point of its scan. One that runs
/// along the lidar's rings may be no edge: any wall shows such lines, which rise or fall as the
/// lidar comes nearer, and take it along. Of such a line the distances along the ray and across the
/// rings count as `weights` says; one that crosses the rings stays as it is, and so does any where
/// both count 1.
[[nodiscard]] FittedSurface weighed_ring_line(const FittedSurface& line,
                                              const Eigen::Vector3d& point_lidar,
                                              const Eigen::Matrix3d& R_map_lidar,
                                              const RingLineWeights& weights);

/// How far a point lies from the middle of the neighbours of its plane, along the plane, in
/// standard deviations of theirs (Mahalanobis distance).
[[nodiscard]] double extrapolation(const FittedSurface& plane, const Neighbours& neighbours,
                                   const Eigen::Vector3d& point_map);

/// c of eq. (9): the share of neighbours with another class than `label`. 0 when `label` or all
/// neighbours are unlabeled, since no label contradicts nothing.
[[nodiscard]] double semantic_inconsistency(const Neighbours& neighbours, SemanticClass label);

/// w of eq. (10) in the mode's form, 0..1. `distance_m` is within [0, 1]; the residual's unit is
/// the metre, as the paper means it.
[[nodiscard]] double weight(Weighting weighting, double alpha, double distance_m,
                            double inconsistency);

/// Residuals of a point against its surface, one along each normal, and what the normal equations
/// need of them.
struct Residual {
  /// n . (T p - centre) [m]; the norm of both is d of eq. (8) or (12).
  std::array<double, 2> distances{};
  /// Derivatives of the distances by the pose tangent (boxplus).
  std::array<PoseTangent, 2> slopes;
  std::size_t count = 0;

  [[nodiscard]] double squared_norm() const {
    return distances[0] * distances[0] + distances[1] * distances[1];
  }
};

[[nodiscard]] Residual residual(const Eigen::Vector3d& point_lidar,
                                const Eigen::Isometry3d& T_map_lidar, const FittedSurface& surface);

}  // namespace stillmap
