#include "core/odometry/telling_points.hpp"

#include <algorithm>

#include "core/odometry/point_alignment.hpp"

namespace stillmap {
namespace {

/// Kernel's weight of a point at a pose; what lies along its ring does not count.
double fit_across_ring(const FeatureMap& points_map, const Eigen::Isometry3d& T_map_lidar,
                       const Eigen::Vector3d& point_lidar, const Eigen::Vector3d& tangent_lidar) {
  constexpr PointAlignmentConfig as_aligned;
  constexpr double squared_kernel_m2 = as_aligned.kernel_m * as_aligned.kernel_m;
  const Eigen::Vector3d point_map = T_map_lidar * point_lidar;
  const Neighbours nearest =
      points_map.nearest(point_map.cast<float>(), 1, static_cast<float>(as_aligned.max_distance_m));
  if (nearest.count == 0) return 0.0;
  const Eigen::Vector3d off = point_map - nearest.points[0].position_map.cast<double>();
  const Eigen::Vector3d tangent_map = T_map_lidar.linear() * tangent_lidar;
  const Eigen::Vector3d across = off - tangent_map.dot(off) * tangent_map;
  const double ratio = squared_kernel_m2 / (squared_kernel_m2 + across.squaredNorm());
  return ratio * ratio;
}

}  // namespace

double gain_of_telling_points(const FeatureSets& features, const FeatureMap& points_map,
                              const Eigen::Isometry3d& T_map_lidar,
                              const Eigen::Isometry3d& T_map_lidar_other,
                              const SweepCorrection& sweep_correction) {
  const bool is_known = std::ranges::any_of(
      features.points, [](const FeaturePoint& point) { return !point.tangent_lidar.isZero(); });
  if (!is_known) return 1.0;
  const Eigen::Vector3d way_lidar =
      T_map_lidar.linear().transpose() *
      (T_map_lidar_other.translation() - T_map_lidar.translation()).normalized();
  double fit = 0.0;
  double other_fit = 0.0;
  for (const FeaturePoint& point : features.points) {
    const Eigen::Vector3d tangent_lidar = point.tangent_lidar.cast<double>();
    const double along_way = tangent_lidar.dot(way_lidar);
    const double tells = 1.0 - along_way * along_way;
    const Eigen::Vector3d point_lidar =
        compensated(point.position_lidar.cast<double>(), point.sweep_part, sweep_correction);
    fit += tells * fit_across_ring(points_map, T_map_lidar, point_lidar, tangent_lidar);
    other_fit += tells * fit_across_ring(points_map, T_map_lidar_other, point_lidar, tangent_lidar);
  }
  return fit > 0.0 ? other_fit / fit : 1.0;
}

}  // namespace stillmap
