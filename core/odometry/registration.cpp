#include "core/odometry/registration.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Neighbours are looked up again once the point has moved this far since [m]; nearer than that
/// they are nearly always the same ones.
constexpr float same_neighbours_m = 0.02F;
/// Motion that the coarse registration can find [m].
constexpr double coarse_reach_m = 3.0;

struct Correspondence {
  Eigen::Vector3d point_lidar;
  FittedSurface surface;
  double inconsistency = 0.0;
  bool found = false;
  /// Where the neighbours were looked up; NaN: not yet.
  Eigen::Vector3f searched_map = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
};

enum class FeatureKind { edge, plane };

/// One correspondence a feature, in the features' order whatever the number of threads.
void find_correspondences(std::span<const FeaturePoint> features, FeatureKind kind,
                          const FeatureMap& map, const Eigen::Isometry3d& T_map_lidar,
                          const RegistrationConfig& config, std::span<Correspondence> found) {
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  const tbb::blocked_range<std::size_t> all(0, features.size(), 128);
  tbb::parallel_for(all, [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      const Eigen::Vector3f point_map = T * features[i].position_lidar;
      if ((point_map - found[i].searched_map).norm() < same_neighbours_m) continue;
      found[i].searched_map = point_map;
      const Neighbours neighbours = map.nearest(
          point_map, config.neighbours, static_cast<float>(config.max_neighbour_distance_m));
      const auto surface = kind == FeatureKind::edge ? fit_line(neighbours) : fit_plane(neighbours);
      found[i].found = surface.has_value();
      if (!surface) continue;
      found[i].point_lidar = features[i].position_lidar.cast<double>();
      found[i].surface = *surface;
      found[i].inconsistency = semantic_inconsistency(neighbours, features[i].label);
    }
  });
}

/// J'WJ and J'We of eq. (13) over the correspondences whose residual is valid.
struct NormalEquations {
  Matrix6d hessian = Matrix6d::Zero();
  PoseTangent gradient = PoseTangent::Zero();
  double weighted_squares = 0.0;
  double weights = 0.0;
  double squared_ranges = 0.0;
  int edges = 0;
  int planes = 0;

  [[nodiscard]] int count() const { return edges + planes; }
};

double robust_factor(const OdometryConfig& config, double squared_distance) {
  const double scale = config.registration.robust_scale_m;
  if (scale == 0.0) return 1.0;
  const double ratio = scale * scale / (scale * scale + squared_distance);
  return ratio * ratio;
}

NormalEquations build_normal_equations(std::span<const Correspondence> correspondences,
                                       std::size_t edge_count, const Eigen::Isometry3d& T_map_lidar,
                                       const OdometryConfig& config) {
  NormalEquations equations;
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    const Correspondence& c = correspondences[i];
    if (!c.found) continue;
    const Residual r = residual(c.point_lidar, T_map_lidar, c.surface);
    const double squared = r.vector.squaredNorm();
    const double distance = std::sqrt(squared);
    if (distance > config.registration.max_residual_m) continue;
    const double w = weight(config.weighting, config.alpha, distance, c.inconsistency) *
                     robust_factor(config, squared);
    if (w <= 0.0) continue;
    equations.hessian.noalias() += w * r.jacobian.transpose() * r.jacobian;
    equations.gradient.noalias() += w * r.jacobian.transpose() * r.vector;
    equations.weighted_squares += w * squared;
    equations.weights += w;
    equations.squared_ranges += w * c.point_lidar.squaredNorm();
    (i < edge_count ? equations.edges : equations.planes) += 1;
  }
  return equations;
}

struct Step {
  PoseTangent tangent;
  bool degenerate = false;
};

/// Gauss-Newton step, without the directions that the scan does not observe. Rotation is scaled by
/// the mean range, so that one unit of it moves points as far as one metre does, and an eigenvalue
/// per unit of weight is the share of residuals that see the direction.
Step solve(const NormalEquations& equations, double min_observability) {
  const double mean_range = std::max(1.0, std::sqrt(equations.squared_ranges / equations.weights));
  PoseTangent scale;
  scale << 1.0, 1.0, 1.0, 1.0 / mean_range, 1.0 / mean_range, 1.0 / mean_range;
  const Matrix6d scaled =
      scale.asDiagonal() * equations.hessian * scale.asDiagonal() / equations.weights;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scaled);
  PoseTangent inverse = PoseTangent::Zero();
  Step step;
  for (int k = 0; k < 6; ++k) {
    if (eigen.eigenvalues()[k] > min_observability)
      inverse[k] = 1.0 / eigen.eigenvalues()[k];
    else
      step.degenerate = true;
  }
  const PoseTangent scaled_gradient = scale.asDiagonal() * equations.gradient / equations.weights;
  step.tangent = -(scale.asDiagonal() * (eigen.eigenvectors() * inverse.asDiagonal() *
                                         eigen.eigenvectors().transpose() * scaled_gradient));
  return step;
}

/// Variance of the weighted residuals times (J'WJ)^-1. Directions that are not observed get the
/// variance of one metre.
Matrix6d covariance_of(const NormalEquations& equations) {
  // A line residual has two degrees of freedom, a plane residual one.
  const double freedom = std::max(1.0, 2.0 * equations.edges + equations.planes - 6.0);
  const double variance = std::max(equations.weighted_squares / freedom, 1e-8);
  const Matrix6d information = equations.hessian / variance + Matrix6d::Identity();
  return information.ldlt().solve(Matrix6d::Identity());
}

/// A prediction that nothing confirmed: 1 m and 0.3 rad.
Matrix6d lost_covariance() {
  PoseTangent variance;
  variance << 1.0, 1.0, 1.0, 0.1, 0.1, 0.1;
  return variance.asDiagonal();
}

}  // namespace

OdometryResult register_features(const FeatureSets& features, const LocalMap& map,
                                 const Eigen::Isometry3d& T_map_lidar_predicted,
                                 const OdometryConfig& config) {
  const RegistrationConfig& limits = config.registration;
  OdometryResult result;
  result.T_map_lidar = T_map_lidar_predicted;
  const std::size_t edge_count = features.edges.size();
  std::vector<Correspondence> correspondences(edge_count + features.planes.size());
  const std::span all(correspondences);
  NormalEquations equations;
  bool degenerate = false;
  for (; result.iterations < limits.max_iterations && !result.converged; ++result.iterations) {
    find_correspondences(features.edges, FeatureKind::edge, map.edges, result.T_map_lidar, limits,
                         all.first(edge_count));
    find_correspondences(features.planes, FeatureKind::plane, map.planes, result.T_map_lidar,
                         limits, all.subspan(edge_count));
    equations = build_normal_equations(correspondences, edge_count, result.T_map_lidar, config);
    if (equations.count() < limits.min_correspondences) break;
    const Step step = solve(equations, limits.min_observability);
    degenerate = step.degenerate;
    result.T_map_lidar = boxplus(result.T_map_lidar, step.tangent);
    result.converged = step.tangent.head<3>().norm() < limits.step_translation_m &&
                       step.tangent.tail<3>().norm() < limits.step_rotation_rad;
  }
  result.edge_correspondences = equations.edges;
  result.plane_correspondences = equations.planes;
  if (equations.count() < limits.min_correspondences || !result.T_map_lidar.matrix().allFinite()) {
    result.T_map_lidar = T_map_lidar_predicted;
    result.health = OdometryHealth::lost;
    result.covariance = lost_covariance();
    return result;
  }
  result.health = degenerate ? OdometryHealth::degenerate : OdometryHealth::good;
  result.rms_residual_m = std::sqrt(equations.weighted_squares / equations.weights);
  result.covariance = covariance_of(equations);
  return result;
}

OdometryConfig coarse_registration_config(OdometryConfig config) {
  config.weighting = Weighting::none;
  config.registration.robust_scale_m = 0.5;
  config.registration.max_neighbour_distance_m = coarse_reach_m;
  config.registration.max_residual_m = coarse_reach_m;
  config.registration.max_iterations = 50;
  config.registration.step_translation_m = 0.01;
  config.registration.step_rotation_rad = 0.001;
  return config;
}

LocalMap make_coarse_map() {
  const LocalMapConfig config{
      .voxel_size_m = coarse_reach_m, .max_points_per_voxel = 32, .min_spacing_m = 0.5};
  return {FeatureMap(config), FeatureMap(config)};
}

}  // namespace stillmap
