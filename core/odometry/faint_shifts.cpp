#include "core/odometry/faint_shifts.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <optional>

#include "core/odometry/pose_search.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/shift_witnesses.hpp"

namespace stillmap {
namespace {

/// A shift is faint where no more than this share of the residuals see it.
constexpr double max_faint_share = 0.05;
/// So far to either side [m]: the local map's points are 0.2 m apart, and the neighbours there are
/// others.
constexpr double beside_m = 0.3;
/// Share of what the features count that must lie worse there.
constexpr double min_fit_lost = 0.005;
/// So many of each kind are asked first, and tell enough where they lose as much as this: five
/// times what chance makes of so few.
constexpr std::size_t few_features = 300;
constexpr double clear_fit_lost = 0.1;
/// How much wider the kernel is: what moves by a metre between scans still counts less than a
/// tenth.
constexpr double wide_kernel_scales = 6.0;

/// Direction of the shift that the scan shows least, along the map's axes.
std::optional<Eigen::Vector3d> faint_shift(const OdometryResult& found) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> shifts(
      found.covariance.topLeftCorner<3, 3>());
  // The covariance is what the residuals scatter over what sees the shift.
  const double freedom =
      std::max(1.0, 2.0 * found.edge_correspondences + found.plane_correspondences - 6.0);
  const double share =
      found.rms_residual_m * found.rms_residual_m / (freedom * shifts.eigenvalues()[2]);
  if (share > max_faint_share) return std::nullopt;
  return shifts.eigenvectors().col(2);
}

}  // namespace

OdometryResult register_with_faint_shifts(const FeatureSets& features, const LocalMap& map,
                                          const Eigen::Isometry3d& T_map_lidar_predicted,
                                          const OdometryConfig& config,
                                          const SweepCorrection& sweep_correction) {
  const OdometryResult direct =
      register_features(features, map, T_map_lidar_predicted, config, sweep_correction);
  const bool is_clear = direct.health == OdometryHealth::lost ||
                        (direct.health == OdometryHealth::good && !faint_shift(direct));
  const bool has_kernel = config.registration.robust_scale_m > 0.0 && !config.paper_exact;
  // Edges and planes of single rings lie along the way, on whatever rail the ring hits: a wider
  // kernel has more of them to choose from, and no more that are right.
  const bool is_by_dense_surfaces = !features.surfaces.empty() && !features.sparse_rings;
  if (is_clear || !has_kernel || !is_by_dense_surfaces) return direct;
  OdometryConfig wide = config;
  wide.registration.robust_scale_m *= wide_kernel_scales;
  wide.registration.plane_deviation_m = wide.registration.sparse_ring_plane_deviation_m = 0.0;
  const OdometryResult first =
      register_features(features, map, T_map_lidar_predicted, wide, sweep_correction);
  if (first.health == OdometryHealth::lost) return direct;
  OdometryResult second =
      register_features(features, map, first.T_map_lidar, config, first.sweep_correction);
  if (second.health == OdometryHealth::lost) return direct;
  if (score_of_first_motion(second, features, map, config) <
      score_of_first_motion(direct, features, map, config))
    return direct;
  second.iterations += direct.iterations + first.iterations;
  return second;
}

OdometryResult doubted_where_shift_fits(OdometryResult found, const FeatureSets& features,
                                        const LocalMap& map, const OdometryConfig& config) {
  if (config.paper_exact || found.health != OdometryHealth::good) return found;
  const auto shift_map = faint_shift(found);
  if (!shift_map) return found;
  const auto fit_lost = [&](const FeatureSets& some) {
    const auto fit_at = [&](double way_m) {
      return counted_fit(some, map, Eigen::Translation3d(way_m * *shift_map) * found.T_map_lidar,
                         config, found.sweep_correction);
    };
    return fit_at(0.0) - 0.5 * (fit_at(-beside_m) + fit_at(beside_m));
  };
  if (fit_lost(downsampled(features, few_features)) >= clear_fit_lost) return found;
  if (fit_lost(features) >= min_fit_lost) return found;
  if (witnesses_tell(likely_shift(found, *shift_map), features, map, found, config)) return found;
  found.health = OdometryHealth::degenerate;
  // 1 m, as of all that the scan does not observe.
  found.covariance.topLeftCorner<3, 3>() += *shift_map * shift_map->transpose();
  return found;
}

}  // namespace stillmap
