#include "core/odometry/point_alignment.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace stillmap {
namespace {

/// Fewer matched points than this align nothing.
constexpr int min_matched = 30;

/// Sums over matched points of what the normal equations of point-to-point ICP are made of. A
/// point's derivative by the pose tangent is [ I | -[arm]x ], arm being the point turned into the
/// map's axes: their products need the weights' moments alone.
struct Equations {
  double weights = 0.0;
  Eigen::Vector3d weighted_arms = Eigen::Vector3d::Zero();
  /// Sum of w arm arm'.
  Eigen::Matrix3d arm_products = Eigen::Matrix3d::Zero();
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();
  /// Of points whose height alone counts: z, and the rotations about x and y.
  Eigen::Matrix3d level_hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d level_gradient = Eigen::Vector3d::Zero();
  int matched = 0;

  void add_point(double weight, const Eigen::Vector3d& arm, const Eigen::Vector3d& residual) {
    weights += weight;
    const Eigen::Vector3d weighted = weight * arm;
    weighted_arms += weighted;
    arm_products += weighted * arm.transpose();
    const Eigen::Vector3d pull = weight * residual;
    force += pull;
    torque += arm.cross(pull);
    ++matched;
  }
  void add_level_point(double weight, const Eigen::Vector3d& arm, double residual_z) {
    const Eigen::Vector3d slope(1.0, arm.y(), -arm.x());
    const Eigen::Vector3d weighted = weight * slope;
    level_hessian += weighted * slope.transpose();
    level_gradient += residual_z * weighted;
  }
  void add(const Equations& other) {
    weights += other.weights;
    weighted_arms += other.weighted_arms;
    arm_products += other.arm_products;
    force += other.force;
    torque += other.torque;
    level_hessian += other.level_hessian;
    level_gradient += other.level_gradient;
    matched += other.matched;
  }

  [[nodiscard]] Eigen::Matrix<double, 6, 6> hessian() const {
    Eigen::Matrix<double, 6, 6> full;
    full.topLeftCorner<3, 3>() = weights * Eigen::Matrix3d::Identity();
    full.topRightCorner<3, 3>() = -skew(weighted_arms);
    full.bottomLeftCorner<3, 3>() = skew(weighted_arms);
    full.bottomRightCorner<3, 3>() =
        arm_products.trace() * Eigen::Matrix3d::Identity() - arm_products;
    full.block<3, 3>(2, 2) += level_hessian;
    return full;
  }
  [[nodiscard]] PoseTangent gradient() const {
    PoseTangent full;
    full.head<3>() = force;
    full.tail<3>() = torque;
    full.segment<3>(2) += level_gradient;
    return full;
  }
};

/// Points and where they are, some of which tell nothing but their height.
struct AlignedPoints {
  AlignedPoints(const FeatureSets& features, const SweepCorrection& sweep_correction,
                const PointAlignmentConfig& config) {
    positions_lidar.reserve(features.points.size() + features.level_points.size());
    const auto add = [&](const FeaturePoint& point) {
      positions_lidar.push_back(
          compensated(point.position_lidar.cast<double>(), point.sweep_part, sweep_correction));
    };
    for (const FeaturePoint& point : features.points)
      if (!config.without_movable || !is_movable(point.label)) add(point);
    first_level = positions_lidar.size();
    std::ranges::for_each(features.level_points, add);
  }

  std::vector<Eigen::Vector3d> positions_lidar;
  /// Those from this one on lie on level ground: where on it is chance.
  std::size_t first_level = 0;
};

/// The nearest point of the map, looked up again only where another one may be nearer by now.
class Counterpart {
 public:
  /// Nothing within `max_distance_m`.
  [[nodiscard]] const Eigen::Vector3f* find(const FeatureMap& points_map,
                                            const Eigen::Vector3f& point_map,
                                            float max_distance_m) {
    if (!is_still_nearest(point_map)) look_up(points_map, point_map, max_distance_m);
    return found_ ? &position_map_ : nullptr;
  }

 private:
  /// All others were at least `second_m_` away from where this was looked up.
  [[nodiscard]] bool is_still_nearest(const Eigen::Vector3f& point_map) const {
    return found_ && (position_map_ - point_map).norm() + (searched_map_ - point_map).norm() <
                         second_m_ - rounding_m;
  }
  void look_up(const FeatureMap& points_map, const Eigen::Vector3f& point_map,
               float max_distance_m) {
    const Neighbours nearest = points_map.nearest(point_map, 2, max_distance_m);
    found_ = nearest.count > 0;
    if (!found_) return;
    searched_map_ = point_map;
    position_map_ = nearest.points[0].position_map;
    second_m_ = nearest.count > 1 ? std::sqrt(nearest.squared_distance[1]) : max_distance_m;
  }

  static constexpr float rounding_m = 1e-3F;
  bool found_ = false;
  Eigen::Vector3f searched_map_;
  Eigen::Vector3f position_map_;
  float second_m_ = 0.0F;
};

Equations equations_of(const AlignedPoints& points, const FeatureMap& points_map,
                       const Eigen::Isometry3d& T_map_lidar, const PointAlignmentConfig& config,
                       std::vector<Counterpart>& counterparts) {
  const tbb::blocked_range<std::size_t> all(0, points.positions_lidar.size(), 128);
  const double squared_kernel = config.kernel_m * config.kernel_m;
  // The deterministic reduction: the same sums whatever the number of threads.
  return tbb::parallel_deterministic_reduce(
      all, Equations{},
      [&](const auto& range, Equations sums) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const Eigen::Vector3d arm = T_map_lidar.linear() * points.positions_lidar[i];
          const Eigen::Vector3d point_map = arm + T_map_lidar.translation();
          const Eigen::Vector3f* const nearest = counterparts[i].find(
              points_map, point_map.cast<float>(), static_cast<float>(config.max_distance_m));
          if (nearest == nullptr) continue;
          Eigen::Vector3d residual = point_map - nearest->cast<double>();
          const bool is_level = i >= points.first_level;
          if (is_level) residual.head<2>().setZero();
          const double ratio = squared_kernel / (squared_kernel + residual.squaredNorm());
          if (is_level)
            sums.add_level_point(ratio * ratio, arm, residual.z());
          else
            sums.add_point(ratio * ratio, arm, residual);
        }
        return sums;
      },
      [](Equations a, const Equations& b) {
        a.add(b);
        return a;
      });
}

}  // namespace

PointAlignment align_points(const FeatureSets& features, const FeatureMap& points_map,
                            const Eigen::Isometry3d& T_map_lidar_start,
                            const SweepCorrection& sweep_correction,
                            const PointAlignmentConfig& config) {
  PointAlignment found{.T_map_lidar = T_map_lidar_start};
  const AlignedPoints points(features, sweep_correction, config);
  std::vector<Counterpart> counterparts(points.positions_lidar.size());
  for (int k = 0; k < config.max_iterations && !found.converged; ++k) {
    const Equations equations =
        equations_of(points, points_map, found.T_map_lidar, config, counterparts);
    found.matched = equations.matched;
    found.fit =
        points.first_level == 0 ? 0.0 : equations.weights / static_cast<double>(points.first_level);
    if (equations.matched < min_matched) return found;
    // What no point shows stays where it is.
    const Eigen::Matrix<double, 6, 6> damped =
        equations.hessian() + Eigen::Matrix<double, 6, 6>::Identity();
    const PoseTangent step = -damped.ldlt().solve(equations.gradient());
    if (!step.allFinite()) return found;
    found.T_map_lidar = boxplus(found.T_map_lidar, step);
    found.converged = step.head<3>().norm() < config.step_translation_m &&
                      step.tail<3>().norm() < config.step_rotation_rad;
  }
  return found;
}

}  // namespace stillmap
