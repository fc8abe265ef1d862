#include "core/odometry/first_motion.hpp"

#include "core/odometry/point_alignment.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// Of two scans whose rings lie close enough a fifth and more fits.
constexpr double max_doubtful_fit = 0.2;
/// Poses that differ by less are the same [m, rad].
constexpr double max_difference_m = 0.1;
constexpr double max_difference_rad = 0.01;
/// How much better the points must lie elsewhere: of a right pose, rings on walls that face a lidar
/// in motion lie a little better where it was. Of wrong ones of lidars at rest it was 1.48 and
/// more.
constexpr double clearly_better = 1.25;

}  // namespace

std::optional<OdometryResult> first_motion_by_points(const OdometryResult& found,
                                                     const FeatureSets& features,
                                                     const LocalMap& map,
                                                     const RegisteredScan& last,
                                                     const OdometryConfig& config) {
  if (found.health == OdometryHealth::lost || found.fit >= max_doubtful_fit) return std::nullopt;
  const PointAlignmentConfig in_place{.max_iterations = 1,
                                      .without_movable = labels_tell_enough(features, config)};
  const auto fit_of_points = [&](const Eigen::Isometry3d& T_map_lidar) {
    return align_points(features, map.points, T_map_lidar, {}, in_place).fit;
  };
  Eigen::Isometry3d T_map_lidar = last.T_map_lidar;
  if (const auto T_coarse = pose_to_last_scan(features, map, last, config))
    if (fit_of_points(*T_coarse) > fit_of_points(T_map_lidar)) T_map_lidar = *T_coarse;
  const PoseTangent difference = boxminus(T_map_lidar, found.T_map_lidar);
  const bool agree = difference.head<3>().norm() < max_difference_m &&
                     difference.tail<3>().norm() < max_difference_rad;
  if (agree || fit_of_points(T_map_lidar) < clearly_better * fit_of_points(found.T_map_lidar))
    return std::nullopt;
  OdometryConfig config_in_place = config;
  config_in_place.registration.max_iterations = 1;
  OdometryResult result = register_features(features, map, T_map_lidar, config_in_place);
  if (result.health == OdometryHealth::lost) return result;
  result.T_map_lidar = T_map_lidar;
  result.sweep_correction = {};
  result.health = OdometryHealth::degenerate;
  return result;
}

}  // namespace stillmap
