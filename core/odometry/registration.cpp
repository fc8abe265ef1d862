#include "core/odometry/registration.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "core/odometry/correspondence_search.hpp"
#include "core/odometry/registration_limits.hpp"
#include "core/odometry/shift_witnesses.hpp"
#include "core/odometry/sweep_equations.hpp"

namespace stillmap {
namespace {

/// Motion that the coarse registration can find [m].
constexpr double coarse_reach_m = 3.0;

/// Sum of w s s' over slopes s, in columns of eight numbers: whole vector registers.
class InformationSum {
 public:
  using Slope = Eigen::Matrix<double, 8, 1>;

  void add(double w, const Slope& slope) {
    for (int column = 0; column < 6; ++column) sum_.col(column) += w * slope[column] * slope;
  }
  [[nodiscard]] Matrix6d matrix() const { return sum_.topRows<6>(); }

 private:
  Eigen::Matrix<double, 8, 6> sum_ = Eigen::Matrix<double, 8, 6>::Zero();
};

double geman_mcclure(double scale, double squared_distance) {
  if (scale == 0.0) return 1.0;
  const double ratio = scale * scale / (scale * scale + squared_distance);
  return ratio * ratio;
}

/// Scale of the robust score of `OdometryResult::fit` [m].
constexpr double fit_scale_m = 0.2;

/// Whether the surface is a plane like the ground, in a map whose z points up.
bool lies_on_level_plane(const FittedSurface& surface) {
  constexpr double min_cosine = 0.8;
  return surface.normal_count == 1 && std::abs(surface.normals[0].z()) > min_cosine;
}

/// Counts how well a feature fits, whatever its weight.
void count_fit(const FittedSurface& surface, double squared_m2, NormalEquations& equations) {
  const double score = geman_mcclure(fit_scale_m, squared_m2);
  const bool is_level = lies_on_level_plane(surface);
  equations.scores += score;
  equations.on_level_planes += is_level ? 1 : 0;
  equations.upright_scores += is_level ? 0.0 : score;
}

/// Adds the weight of a feature and its arm from the lidar.
void add_arm(double w, const Correspondence& c, std::size_t residuals,
             const Eigen::Isometry3d& T_map_lidar, NormalEquations& equations) {
  const auto& weights = c.surface.weights;
  const double w_surface = w * *std::max_element(weights.begin(), weights.begin() + residuals);
  const Eigen::Vector3d arm_map = T_map_lidar.linear() * c.point_lidar;
  equations.weights += w_surface;
  equations.arms += w_surface * (arm_map.squaredNorm() * Eigen::Matrix3d::Identity() -
                                 arm_map * arm_map.transpose());
}

/// Sums of a sweep that rolls: over the motion within it, and over that with the pose.
class SweepSums {
 public:
  using Slope = InformationSum::Slope;

  /// A residual of weight w at this part of the sweep, which pulls along its slope.
  void add(double part, double w, double pull, const Slope& slope) {
    pose_twist_.add(part * w, slope);
    twist_.add(part * part * w, slope);
    gradient_.head<6>() += part * pull * slope.head<6>();
    const double bend_slope = part * part * slope[5];
    pose_bend_ += w * bend_slope * slope;
    twist_bend_ += part * w * bend_slope * slope;
    bend_ += w * bend_slope * bend_slope;
    gradient_[bend_of_sweep] += pull * bend_slope;
  }
  void write_to(NormalEquations& equations) const {
    equations.gradient_sweep = gradient_;
    equations.hessian_pose_sweep << pose_twist_.matrix(), pose_bend_.head<6>();
    equations.hessian_sweep.topLeftCorner<6, 6>() = twist_.matrix();
    equations.hessian_sweep.block<6, 1>(0, bend_of_sweep) = twist_bend_.head<6>();
    equations.hessian_sweep.block<1, 6>(bend_of_sweep, 0) = twist_bend_.head<6>().transpose();
    equations.hessian_sweep(bend_of_sweep, bend_of_sweep) = bend_;
  }

 private:
  InformationSum pose_twist_, twist_;
  Slope pose_bend_ = Slope::Zero();
  Slope twist_bend_ = Slope::Zero();
  double bend_ = 0.0;
  SweepTangent gradient_ = SweepTangent::Zero();
};

NormalEquations build_normal_equations(std::span<const Correspondence> correspondences,
                                       std::size_t edge_count, bool rolling, bool weighs_planes,
                                       const Eigen::Isometry3d& T_map_lidar,
                                       const OdometryConfig& config) {
  NormalEquations equations;
  InformationSum hessian;
  SweepSums sweep;
  InformationSum::Slope slope = InformationSum::Slope::Zero();
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    const Correspondence& c = correspondences[i];
    if (!c.found) continue;
    const Residual r = residual(c.point_lidar, T_map_lidar, c.surface);
    const double squared = r.squared_norm();
    const double distance = std::sqrt(squared);
    if (distance > config.registration.max_residual_m) continue;
    count_fit(c.surface, squared, equations);
    const double w = weight(config.weighting, config.alpha, distance, c.inconsistency) *
                     geman_mcclure(config.registration.robust_scale_m, squared) *
                     (weighs_planes ? c.thinness : 1.0);
    if (w <= 0.0) continue;
    for (std::size_t k = 0; k < r.count; ++k) {
      const double w_k = w * c.surface.weights[k];
      if (w_k == 0.0) continue;
      slope.head<6>() = r.slopes[k];
      const double pull = w_k * r.distances[k];
      hessian.add(w_k, slope);
      equations.gradient += pull * r.slopes[k];
      equations.weighted_squares += pull * r.distances[k];
      if (rolling) sweep.add(c.sweep_part, w_k, pull, slope);
    }
    add_arm(w, c, r.count, T_map_lidar, equations);
    (i < edge_count ? equations.edges : equations.planes) += 1;
  }
  equations.hessian = hessian.matrix();
  sweep.write_to(equations);
  return equations;
}

/// A scan of nothing but rings on level ground has none.
constexpr double least_weights = 1e-9;

/// Along a tunnel the noise of its walls' normals looks like so large a share of residuals that see
/// the way: it is followed, and no pose is good by it.
constexpr double min_shift_observability = 0.01;

/// The pose error along the eigenvectors of J'WJ. Rotation is scaled by the points' mean arm about
/// each axis, so that one unit of it moves points as far as one metre does, and an eigenvalue per
/// unit of weight is the share of residuals that see the direction. Of an aisle's points far ahead
/// the arm of a roll is the aisle's width, not their range.
class ErrorDirections {
 public:
  ErrorDirections(const NormalEquations& equations, double min_observability)
      : equations_(equations),
        weights_(std::max(equations.weights, least_weights)),
        min_observability_(min_observability) {
    constexpr double min_squared_arm_m2 = 1.0;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> arms(equations.arms / weights_);
    const Eigen::Vector3d squared_arms_m2 = arms.eigenvalues().cwiseMax(min_squared_arm_m2);
    scale_.bottomRightCorner<3, 3>() = arms.eigenvectors() *
                                       squared_arms_m2.cwiseSqrt().cwiseInverse().asDiagonal() *
                                       arms.eigenvectors().transpose();
    eigen_.compute(scale_ * equations.hessian * scale_ / weights_);
  }

  /// Whether the scan observes all of them, and shifts by more than the noise of normals looks
  /// like.
  [[nodiscard]] bool are_clear() const {
    for (int k = 0; k < 6; ++k)
      if (!is_clear(k)) return false;
    return true;
  }

  /// The shifts that are not clear, each by one metre with the turn that goes with it; nothing
  /// where a direction is not observed at all.
  [[nodiscard]] std::optional<std::vector<PoseTangent>> unclear_shifts() const {
    std::vector<PoseTangent> shifts;
    for (int k = 0; k < 6; ++k) {
      if (!observes(k)) return std::nullopt;
      if (is_clear(k)) continue;
      const PoseTangent along = scale_ * eigen_.eigenvectors().col(k);
      shifts.emplace_back(along / along.head<3>().norm());
    }
    return shifts;
  }

  /// Gauss-Newton step, without the directions that the scan does not observe.
  [[nodiscard]] PoseTangent step() const {
    const PoseTangent gradient = scale_ * equations_.gradient / weights_;
    PoseTangent along = eigen_.eigenvectors().transpose() * gradient;
    for (int k = 0; k < 6; ++k) along[k] *= observes(k) ? -1.0 / eigen_.eigenvalues()[k] : 0.0;
    return scale_ * (eigen_.eigenvectors() * along);
  }

  /// Variance of the weighted residuals times (J'WJ)^-1. Directions that are not clear, in which
  /// the pose may be the prediction, get the variance of one metre, unless all shifts are told.
  [[nodiscard]] Matrix6d covariance(bool shifts_are_told) const {
    // A line residual has two degrees of freedom, a plane residual one.
    const double freedom = std::max(1.0, 2.0 * equations_.edges + equations_.planes - 6.0);
    const double variance = std::max(equations_.weighted_squares / freedom, 1e-8);
    PoseTangent deviation;
    for (int k = 0; k < 6; ++k) {
      const bool counts = is_clear(k) || (shifts_are_told && observes(k));
      const double information = counts ? eigen_.eigenvalues()[k] * weights_ / variance : 0.0;
      deviation[k] = 1.0 / std::sqrt(1.0 + information);
    }
    const Matrix6d root = scale_ * eigen_.eigenvectors() * deviation.asDiagonal();
    return root * root.transpose();
  }

 private:
  [[nodiscard]] bool observes(int k) const { return eigen_.eigenvalues()[k] > min_observability_; }
  [[nodiscard]] bool is_clear(int k) const {
    const double shift = eigen_.eigenvectors().col(k).head<3>().squaredNorm();
    return observes(k) && eigen_.eigenvalues()[k] >= shift * min_shift_observability;
  }

  const NormalEquations& equations_;
  double weights_;
  double min_observability_;
  Matrix6d scale_ = Matrix6d::Identity();
  Eigen::SelfAdjointEigenSolver<Matrix6d> eigen_;
};

/// Whether it is no longer than so many steps below which registration has converged.
bool is_small(const PoseTangent& tangent, double steps, const RegistrationConfig& limits) {
  return tangent.head<3>().norm() < steps * limits.step_translation_m &&
         tangent.tail<3>().norm() < steps * limits.step_rotation_rad;
}

/// Planes are weighed by their thickness once a step is shorter than so many of those.
constexpr double near_steps = 10.0;

/// Moves the pose, and with a `sweep_prior` the motion within the sweep, by one step. `equations`
/// are those of the pose alone afterwards. Returns whether a direction is not observed.
bool take_step(const SweepPrior* sweep_prior, const RegistrationConfig& limits,
               NormalEquations& equations, OdometryResult& result) {
  std::optional<SweepElimination> sweep;
  if (sweep_prior) {
    add_sweep_prior(*sweep_prior, result, limits, equations);
    sweep.emplace(equations);
    equations = sweep->reduced(equations);
  }
  const ErrorDirections directions(equations, limits.min_observability);
  const PoseTangent step = directions.step();
  PoseTangent sweep_step = PoseTangent::Zero();
  double bend_step_rad = 0.0;
  if (sweep) {
    const SweepTangent along_map = sweep->step(step);
    const Eigen::Matrix3d R_lidar_map = result.T_map_lidar.linear().transpose();
    sweep_step = rotated(R_lidar_map, along_map.head<6>());
    result.sweep_correction.twist += sweep_step;
    bend_step_rad = along_map[bend_of_sweep];
    result.sweep_correction.bend += bend_step_rad * R_lidar_map.col(2);
  }
  result.T_map_lidar = boxplus(result.T_map_lidar, step);
  result.converged = is_small(step, 1.0, limits) && is_small(sweep_step, 2.0, limits) &&
                     std::abs(bend_step_rad) < 4.0 * limits.step_rotation_rad;
  return !directions.are_clear();
}

/// Whether few residuals see some shifts, but these agree on where the scan lies.
bool shifts_are_told(const ErrorDirections& directions, const FeatureSets& features,
                     const LocalMap& map, const OdometryConfig& config,
                     const OdometryResult& result) {
  if (config.paper_exact) return false;
  const auto shifts = directions.unclear_shifts();
  return shifts && std::ranges::all_of(*shifts, [&](const PoseTangent& shift) {
           return witnesses_tell(shift, features, map, result, config);
         });
}

/// What the last iteration says of how well the scan lies on the map.
void take_fit(std::span<const Correspondence> correspondences, const NormalEquations& equations,
              OdometryResult& result) {
  result.edge_correspondences = equations.edges;
  result.plane_correspondences = equations.planes;
  const auto known = static_cast<double>(std::ranges::count_if(
      correspondences, [](const Correspondence& c) { return c.in_known_space; }));
  result.upright_fit = equations.upright_scores / std::max(1.0, known - equations.on_level_planes);
  const double count = std::max(1.0, static_cast<double>(correspondences.size()));
  result.fit = equations.scores / count;
  result.overlap = known / count;
}

}  // namespace

LocalMap::LocalMap(const LocalMapConfig& config)
    : edges(config),
      planes(config),
      points({.voxel_size_m = 1.5,
              .max_points_per_voxel = 20,
              .min_spacing_m = 0.5,
              .radius_m = config.radius_m}) {}

void LocalMap::clear() {
  edges.clear();
  planes.clear();
  points.clear();
}

OdometryResult lost_at(const Eigen::Isometry3d& T_map_lidar_predicted) {
  // 1 m and 0.3 rad.
  PoseTangent variance;
  variance << 1.0, 1.0, 1.0, 0.1, 0.1, 0.1;
  OdometryResult result;
  result.T_map_lidar = T_map_lidar_predicted;
  result.health = OdometryHealth::lost;
  result.map_entry = MapEntry::stays_out_with_waiting;
  result.covariance = variance.asDiagonal();
  return result;
}

Eigen::Vector3d compensated(const Eigen::Vector3d& point_lidar, double sweep_part,
                            const SweepCorrection& motion) {
  if (sweep_part == 0.0) return point_lidar;
  const Eigen::Vector3d t = sweep_part * motion.twist.head<3>();
  const Eigen::Vector3d r = sweep_part * (motion.twist.tail<3>() + sweep_part * motion.bend);
  const Eigen::Vector3d moved = t + r.cross(point_lidar);
  return point_lidar + moved + 0.5 * r.cross(moved);
}

OdometryResult register_features(const FeatureSets& features, const LocalMap& map,
                                 const Eigen::Isometry3d& T_map_lidar_predicted,
                                 const OdometryConfig& config,
                                 const SweepCorrection& sweep_correction) {
  const RegistrationLimits limits = limits_for(features, config.registration);
  OdometryResult result;
  result.T_map_lidar = T_map_lidar_predicted;
  result.sweep_correction = sweep_correction;
  const bool rolling = features.rolling && limits.sweep_translation_m > 0.0;
  std::vector<Correspondence> correspondences(count_of(features));
  NormalEquations equations;
  bool degenerate = false;
  bool weighs_planes = false;
  for (; result.iterations < limits.max_iterations && !result.converged; ++result.iterations) {
    find_all_correspondences(features, map, result, limits, correspondences);
    equations = build_normal_equations(correspondences, features.edges.size(), rolling,
                                       weighs_planes, result.T_map_lidar, config);
    if (equations.count() < limits.min_correspondences) break;
    const Eigen::Isometry3d before = result.T_map_lidar;
    degenerate = take_step(rolling ? &features.sweep_prior : nullptr, limits, equations, result);
    if (weighs_planes || limits.plane_deviation_m == 0.0) continue;
    weighs_planes = is_small(boxminus(result.T_map_lidar, before), near_steps, limits);
    if (weighs_planes) result.converged = false;
  }
  take_fit(correspondences, equations, result);
  if (equations.count() < limits.min_correspondences || !result.T_map_lidar.matrix().allFinite()) {
    OdometryResult lost = lost_at(T_map_lidar_predicted);
    lost.iterations = result.iterations;
    return lost;
  }
  const ErrorDirections directions(equations, limits.min_observability);
  const bool is_told = degenerate && shifts_are_told(directions, features, map, config, result);
  result.health = degenerate && !is_told ? OdometryHealth::degenerate : OdometryHealth::good;
  result.rms_residual_m =
      std::sqrt(equations.weighted_squares / std::max(equations.weights, least_weights));
  result.covariance = directions.covariance(is_told);
  return result;
}

double counted_fit(const FeatureSets& features, const LocalMap& map,
                   const Eigen::Isometry3d& T_map_lidar, const OdometryConfig& config,
                   const SweepCorrection& sweep_correction) {
  OdometryResult pose;
  pose.T_map_lidar = T_map_lidar;
  pose.sweep_correction = sweep_correction;
  std::vector<Correspondence> correspondences(count_of(features));
  find_all_correspondences(features, map, pose, limits_for(features, config.registration),
                           correspondences);
  double scores = 0.0;
  double weights = 0.0;
  for (const Correspondence& c : correspondences) {
    if (!c.found) {
      weights += 1.0;
      continue;
    }
    const Residual r = residual(c.point_lidar, T_map_lidar, c.surface);
    double squared = 0.0;
    double weight = 0.0;
    for (std::size_t k = 0; k < r.count; ++k) {
      squared += c.surface.weights[k] * r.distances[k] * r.distances[k];
      weight = std::max(weight, c.surface.weights[k]);
    }
    weights += weight;
    scores += weight * geman_mcclure(fit_scale_m, squared);
  }
  return scores / std::max(least_weights, weights);
}

OdometryResult register_in_two_stages(const FeatureSets& features, const LocalMap& map,
                                      const Eigen::Isometry3d& T_map_lidar_predicted,
                                      const OdometryConfig& config) {
  OdometryConfig wide = config;
  wide.weighting = Weighting::none;
  wide.registration.robust_scale_m = 0.0;
  wide.registration.plane_deviation_m = wide.registration.sparse_ring_plane_deviation_m = 0.0;
  const OdometryResult first = register_features(features, map, T_map_lidar_predicted, wide);
  if (first.health == OdometryHealth::lost) return first;
  OdometryResult second =
      register_features(features, map, first.T_map_lidar, config, first.sweep_correction);
  second.iterations += first.iterations;
  return second;
}

OdometryConfig coarse_registration_config(OdometryConfig config) {
  config.registration.sweep_translation_m = 0.0;
  config.weighting = Weighting::none;
  config.registration.robust_scale_m = 0.5;
  config.registration.plane_deviation_m = config.registration.sparse_ring_plane_deviation_m = 0.0;
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
  return LocalMap(config);
}

}  // namespace stillmap
