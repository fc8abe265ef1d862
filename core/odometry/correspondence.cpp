#include "core/odometry/correspondence.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Neighbours that a line or a plane needs.
constexpr int min_neighbours = 5;
/// The line's eigenvalue is this many times the next one (A-LOAM).
constexpr double line_dominance = 3.0;
/// No neighbour lies farther from its plane than this [m] (A-LOAM).
constexpr double plane_thickness_m = 0.2;
/// Neighbours nearly on one line do not say how their plane is turned about it.
constexpr double min_plane_width_share = 0.05;

struct Pca {
  Eigen::Vector3d centre;
  /// Ascending.
  Eigen::Vector3d eigenvalues;
  Eigen::Matrix3d eigenvectors;
};

Pca pca(const Neighbours& neighbours) {
  const auto count = static_cast<std::size_t>(neighbours.count);
  Pca result;
  result.centre.setZero();
  for (std::size_t k = 0; k < count; ++k)
    result.centre += neighbours.points[k].position_map.cast<double>();
  result.centre /= static_cast<double>(count);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d d = neighbours.points[k].position_map.cast<double>() - result.centre;
    covariance += d * d.transpose();
  }
  covariance /= static_cast<double>(count);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  result.eigenvalues = solver.eigenvalues();
  result.eigenvectors = solver.eigenvectors();
  return result;
}

std::optional<FittedSurface> line_of(const Pca& fit) {
  // Written so that points all at one place are no line either.
  if (!(fit.eigenvalues[2] > line_dominance * fit.eigenvalues[1])) return std::nullopt;
  return FittedSurface{fit.centre, {fit.eigenvectors.col(0), fit.eigenvectors.col(1)}, 2};
}

std::optional<FittedSurface> plane_of(const Pca& fit, const Neighbours& neighbours) {
  if (!(fit.eigenvalues[1] > min_plane_width_share * fit.eigenvalues[2])) return std::nullopt;
  const Eigen::Vector3d n = fit.eigenvectors.col(0);
  for (std::size_t k = 0; k < static_cast<std::size_t>(neighbours.count); ++k) {
    const Eigen::Vector3d d = neighbours.points[k].position_map.cast<double>() - fit.centre;
    if (std::abs(n.dot(d)) > plane_thickness_m) return std::nullopt;
  }
  return FittedSurface{fit.centre, {n, Eigen::Vector3d::Zero()}, 1};
}

}  // namespace

std::optional<FittedSurface> fit_line(const Neighbours& neighbours) {
  if (neighbours.count < min_neighbours) return std::nullopt;
  return line_of(pca(neighbours));
}

std::optional<FittedSurface> fit_plane(const Neighbours& neighbours) {
  if (neighbours.count < min_neighbours) return std::nullopt;
  return plane_of(pca(neighbours), neighbours);
}

std::optional<FittedSurface> fit_surface(const Neighbours& neighbours) {
  if (neighbours.count < min_neighbours) return std::nullopt;
  const Pca fit = pca(neighbours);
  if (auto plane = plane_of(fit, neighbours)) return plane;
  return line_of(fit);
}

double semantic_inconsistency(const Neighbours& neighbours, SemanticClass label) {
  if (label == SemanticClass::unlabeled) return 0.0;
  int labelled = 0;
  int different = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(neighbours.count); ++k) {
    if (neighbours.points[k].label == SemanticClass::unlabeled) continue;
    ++labelled;
    different += neighbours.points[k].label != label ? 1 : 0;
  }
  return labelled == 0 ? 0.0 : static_cast<double>(different) / labelled;
}

double weight(Weighting weighting, double alpha, double distance_m, double inconsistency) {
  switch (weighting) {
    case Weighting::none:
      return 1.0;
    case Weighting::geometric:
      return std::max(0.0, 1.0 - distance_m);
    case Weighting::semantic:
      break;
  }
  return std::max(0.0, 1.0 - alpha * distance_m - (1.0 - alpha) * inconsistency);
}

Residual residual(const Eigen::Vector3d& point_lidar, const Eigen::Isometry3d& T_map_lidar,
                  const FittedSurface& surface) {
  const Eigen::Vector3d arm = T_map_lidar.linear() * point_lidar;
  const Eigen::Vector3d off_centre = arm + T_map_lidar.translation() - surface.centre_map;
  Residual r;
  r.count = surface.normal_count;
  for (std::size_t k = 0; k < r.count; ++k) {
    r.distances[k] = surface.normals[k].dot(off_centre);
    r.slopes[k].head<3>() = surface.normals[k];
    r.slopes[k].tail<3>() = arm.cross(surface.normals[k]);
  }
  return r;
}

}  // namespace stillmap
