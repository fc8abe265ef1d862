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

struct Equations {
  Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();
  PoseTangent gradient = PoseTangent::Zero();
  double weights = 0.0;
  int matched = 0;

  void add(const Equations& other) {
    hessian += other.hessian;
    gradient += other.gradient;
    weights += other.weights;
    matched += other.matched;
  }
};

/// Points and where they are, some of which tell nothing but their height.
struct AlignedPoints {
  AlignedPoints(const FeatureSets& features, const PoseTangent& sweep_correction,
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
  const Eigen::Vector3d height_alone(0.0, 0.0, 1.0);
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
          const bool is_level = i >= points.first_level;
          Eigen::Vector3d residual = point_map - nearest->cast<double>();
          Eigen::Matrix<double, 3, 6> jacobian;
          jacobian << Eigen::Matrix3d::Identity(), -skew(arm);
          if (is_level) {
            residual = residual.cwiseProduct(height_alone);
            jacobian = height_alone.asDiagonal() * jacobian;
          }
          const double ratio = squared_kernel / (squared_kernel + residual.squaredNorm());
          const double weight = ratio * ratio;
          sums.hessian += weight * jacobian.transpose() * jacobian;
          sums.gradient += weight * jacobian.transpose() * residual;
          if (is_level) continue;
          sums.weights += weight;
          ++sums.matched;
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
                            const PoseTangent& sweep_correction,
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
        equations.hessian + Eigen::Matrix<double, 6, 6>::Identity();
    const PoseTangent step = -damped.ldlt().solve(equations.gradient);
    if (!step.allFinite()) return found;
    found.T_map_lidar = boxplus(found.T_map_lidar, step);
    found.converged = step.head<3>().norm() < config.step_translation_m &&
                      step.tail<3>().norm() < config.step_rotation_rad;
  }
  return found;
}

}  // namespace stillmap
