#include "core/odometry/flat_fit.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "core/odometry/scan_features.hpp"
#include "core/odometry/shift_witnesses.hpp"

namespace stillmap {
namespace {

/// So far to either side of the pose, along the level direction that the scan shows least [m]: out
/// of the reach of the plants and drops of one place.
constexpr double beside_m = 0.6;
/// What the fit must lose there. Of most sound drives the mean of some scans is 0.036 and more (a
/// motorway between noise barriers; among crops 0.08, in streets 0.1 to 0.4), of car parks by 16
/// rings 0.018, and of drives that slide between plants less than 0.01.
constexpr double min_mean_lost = 0.015;
/// Weight of the newest scan in the running mean, and as much as one counts for at most: what is
/// clear again is believed soon.
constexpr double mean_gain = 0.2;
constexpr double max_counted_lost = 0.1;
/// Where it has lately been as clear as this, as in streets, one scan of so many is asked.
constexpr double clear_mean_lost = 0.085;
constexpr int interval_where_clear = 5;

}  // namespace

OdometryResult FlatFit::doubted(OdometryResult found, const FeatureSets& features,
                                const LocalMap& map, const OdometryConfig& config) {
  if (config.paper_exact || found.health == OdometryHealth::lost ||
      found.health == OdometryHealth::initialised)
    return found;
  // Rings on the ground lie as they do wherever the lidar is: by edges and planes of single rings
  // even right poses fit better beside.
  if (features.surfaces.empty()) return found;
  if (mean_lost_ >= clear_mean_lost && ++unasked_ < interval_where_clear) return found;
  unasked_ = 0;
  const FeatureSets some = downsampled(features);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> level(
      found.covariance.topLeftCorner<2, 2>());
  const Eigen::Vector3d beside_map(level.eigenvectors()(0, 1), level.eigenvectors()(1, 1), 0.0);
  const auto fit_at = [&](double way_m) {
    return counted_fit(some, map, Eigen::Translation3d(way_m * beside_map) * found.T_map_lidar,
                       config, found.sweep_correction);
  };
  const double lost = fit_at(0.0) - std::max(fit_at(-beside_m), fit_at(beside_m));
  const double counted = std::clamp(lost, -max_counted_lost, max_counted_lost);
  mean_lost_ += mean_gain * (counted - mean_lost_);
  if (mean_lost_ >= min_mean_lost ||
      witnesses_tell(likely_shift(found, beside_map), features, map, found, config))
    return found;
  if (found.health == OdometryHealth::good) found.health = OdometryHealth::degenerate;
  // 1 m, as of all that the scan does not observe.
  found.covariance.topLeftCorner<3, 3>() += beside_map * beside_map.transpose();
  return found;
}

}  // namespace stillmap
