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
/// A line is an edge when it crosses the rings at an angle with at least this sine.
constexpr double min_sine_to_ring = 0.5;
/// A plane that leans over its ring by up to this sine does so by the noise of its points; one that
/// leans by more than the other is none.
constexpr double noise_sine = 0.5;
constexpr double across_sine = 0.8;

/// Mean and covariance of the neighbours.
struct Moments {
  Eigen::Vector3d centre;
  Eigen::Matrix3d covariance;
};

Moments moments_of(const Neighbours& neighbours) {
  const auto count = static_cast<std::size_t>(neighbours.count);
  // About one of them, all others being near: far from the map's origin squares lose their digits.
  const Eigen::Vector3f& first = neighbours.points[0].position_map;
  double x = 0.0, y = 0.0, z = 0.0;
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;
  for (std::size_t k = 1; k < count; ++k) {
    const Eigen::Vector3f& point = neighbours.points[k].position_map;
    const double dx = static_cast<double>(point.x()) - static_cast<double>(first.x());
    const double dy = static_cast<double>(point.y()) - static_cast<double>(first.y());
    const double dz = static_cast<double>(point.z()) - static_cast<double>(first.z());
    x += dx;
    y += dy;
    z += dz;
    xx += dx * dx;
    xy += dx * dy;
    xz += dx * dz;
    yy += dy * dy;
    yz += dy * dz;
    zz += dz * dz;
  }
  const double share = 1.0 / static_cast<double>(count);
  const Eigen::Vector3d mean = share * Eigen::Vector3d(x, y, z);
  Eigen::Matrix3d squares;
  squares << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return {first.cast<double>() + mean, share * squares - mean * mean.transpose()};
}

/// Smallest eigenvalue of a positive semidefinite matrix of trace 1, by Newton's method from 0: the
/// characteristic polynomial rises and is concave up to there, so that no step goes too far.
/// `minors` and `determinant` are its other two coefficients.
double smallest_eigenvalue(double minors, double determinant) {
  constexpr int max_steps = 20;
  constexpr double precision = 1e-14;
  double value = 0.0;
  for (int k = 0; k < max_steps; ++k) {
    const double polynomial = ((value - 1.0) * value + minors) * value - determinant;
    const double slope = (3.0 * value - 2.0) * value + minors;
    if (!(slope > 0.0)) break;
    const double step = -polynomial / slope;
    if (!(step > precision)) break;
    value += step;
  }
  return value;
}

/// Null vector of a symmetric matrix of rank 2: the longest product of two of its rows, as long as
/// that is.
Eigen::Vector3d null_vector(const Eigen::Matrix3d& m) {
  const Eigen::Vector3d candidates[] = {m.col(0).cross(m.col(1)), m.col(0).cross(m.col(2)),
                                        m.col(1).cross(m.col(2))};
  return *std::ranges::max_element(candidates, {}, &Eigen::Vector3d::squaredNorm);
}

/// The normal of what is flat and spread in two directions, by its covariance; no trigonometry, as
/// a general solver has it.
std::optional<Eigen::Vector3d> normal_of(const Eigen::Matrix3d& covariance, double min_width) {
  constexpr double least_length = 1e-9;
  const double trace = covariance.trace();
  if (!(trace > 0.0)) return std::nullopt;
  const Eigen::Matrix3d m = covariance / trace;
  const double minors = m(0, 0) * m(1, 1) - m(0, 1) * m(0, 1) + m(0, 0) * m(2, 2) -
                        m(0, 2) * m(0, 2) + m(1, 1) * m(2, 2) - m(1, 2) * m(1, 2);
  const double smallest = smallest_eigenvalue(minors, m.determinant());
  // The others from their sum and product.
  const double sum = 1.0 - smallest;
  const double product = minors - smallest * sum;
  const double largest = 0.5 * (sum + std::sqrt(std::max(0.0, sum * sum - 4.0 * product)));
  if (!(sum - largest > min_width * largest)) return std::nullopt;
  const Eigen::Vector3d normal = null_vector(m - smallest * Eigen::Matrix3d::Identity());
  const double length = normal.norm();
  if (!(length > least_length)) return std::nullopt;
  return normal / length;
}

std::optional<FittedSurface> line_of(const Moments& moments) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(moments.covariance);
  // Written so that points all at one place are no line either.
  if (!(solver.eigenvalues()[2] > line_dominance * solver.eigenvalues()[1])) return std::nullopt;
  return FittedSurface{
      moments.centre, {solver.eigenvectors().col(0), solver.eigenvectors().col(1)}, 2};
}

std::optional<FittedSurface> plane_of(const Moments& moments, const Neighbours& neighbours,
                                      double min_width) {
  const std::optional<Eigen::Vector3d> normal = normal_of(moments.covariance, min_width);
  if (!normal) return std::nullopt;
  for (std::size_t k = 0; k < static_cast<std::size_t>(neighbours.count); ++k) {
    const Eigen::Vector3d d = neighbours.points[k].position_map.cast<double>() - moments.centre;
    if (std::abs(normal->dot(d)) > plane_thickness_m) return std::nullopt;
  }
  FittedSurface plane{moments.centre, {*normal, Eigen::Vector3d::Zero()}, 1};
  plane.variance_m2 = normal->dot(moments.covariance * *normal);
  return plane;
}

}  // namespace

std::optional<FittedSurface> fit_line(const Neighbours& neighbours) {
  if (neighbours.count < min_neighbours) return std::nullopt;
  return line_of(moments_of(neighbours));
}

std::optional<FittedSurface> fit_plane(const Neighbours& neighbours, double min_width) {
  if (neighbours.count < min_neighbours) return std::nullopt;
  return plane_of(moments_of(neighbours), neighbours, min_width);
}

std::optional<FittedSurface> fit_surface(const Neighbours& neighbours, double min_plane_width) {
  if (neighbours.count < min_neighbours) return std::nullopt;
  const Moments moments = moments_of(neighbours);
  if (auto plane = plane_of(moments, neighbours, min_plane_width)) return plane;
  return line_of(moments);
}

std::optional<FittedSurface> fit_wide_surface(Neighbours& neighbours, int few,
                                              double min_plane_width) {
  if (auto plane = fit_plane(neighbours, min_plane_width)) return plane;
  neighbours.count = std::min(neighbours.count, few);
  return fit_surface(neighbours, min_plane_width);
}

std::optional<FittedSurface> surface_along(const FittedSurface& surface,
                                           const Eigen::Vector3d& tangent_map) {
  if (surface.normal_count == 2) {
    const Eigen::Vector3d along_map = surface.normals[0].cross(surface.normals[1]);
    const Eigen::Vector3d normal = along_map.cross(tangent_map);
    if (!(normal.norm() > min_sine_to_ring)) return surface;
    return FittedSurface{surface.centre_map, {normal.normalized(), Eigen::Vector3d::Zero()}, 1};
  }
  const Eigen::Vector3d& normal = surface.normals[0];
  const double lean = normal.dot(tangent_map);
  if (std::abs(lean) <= noise_sine) return surface;
  if (std::abs(lean) > across_sine) return std::nullopt;
  FittedSurface turned = surface;
  turned.normals[0] = (normal - lean * tangent_map).normalized();
  return turned;
}

FittedSurface weighed_ring_line(const FittedSurface& line, const Eigen::Vector3d& point_lidar,
                                const Eigen::Matrix3d& R_map_lidar,
                                const RingLineWeights& weights) {
  const double level_m = point_lidar.head<2>().norm();
  const bool count_fully = weights.along_ray == 1.0 && weights.across_rings == 1.0;
  if (line.normal_count != 2 || count_fully || !(level_m > 0.0)) return line;
  // Where the next ring would meet a surface that faces the lidar.
  const Eigen::Vector3d across_lidar(-point_lidar.x() * point_lidar.z() / level_m,
                                     -point_lidar.y() * point_lidar.z() / level_m, level_m);
  const Eigen::Vector3d across_map = R_map_lidar * across_lidar.normalized();
  const Eigen::Vector3d along_map = line.normals[0].cross(line.normals[1]);
  if (std::abs(across_map.dot(along_map)) >= min_sine_to_ring) return line;
  const Eigen::Vector3d along_ray_map = across_map.cross(along_map).normalized();
  return {line.centre_map,
          {along_ray_map, along_map.cross(along_ray_map)},
          2,
          {weights.along_ray, weights.across_rings}};
}

double extrapolation(const FittedSurface& plane, const Neighbours& neighbours,
                     const Eigen::Vector3d& point_map) {
  const Eigen::Vector3d& normal = plane.normals[0];
  const Eigen::Vector3d off_centre = point_map - plane.centre_map;
  const Eigen::Vector3d along = off_centre - normal.dot(off_centre) * normal;
  const Eigen::Matrix3d covariance = moments_of(neighbours).covariance;
  // As thick as it is wide, which changes nothing along it, and can be inverted.
  const Eigen::Matrix3d thick = covariance + covariance.trace() * normal * normal.transpose();
  return std::sqrt(std::max(0.0, along.dot(thick.inverse() * along)));
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
