#include "core/odometry/pose_search.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/odometry/relocalization.hpp"
#include "core/odometry/scan_features.hpp"

namespace stillmap {
namespace {

/// Starts for the motion to the second scan: rings of this many directions [m].
constexpr int first_motion_rings = 4;
constexpr int first_motion_directions = 8;
constexpr double first_motion_spacing_m = 0.75;
constexpr double min_gain_of_other_start = 1.1;
/// Gaps longer than this are looked across from where the lidar was last, too [s].
constexpr double short_gap_s = 1.0;
/// After a gap of up to this the lidar may have gone straight on [s].
constexpr double max_gap_s = 10.0;
/// Where these fail, poses so far from the last one are judged by the landmarks alone [m], and so
/// many are tried.
constexpr double proposal_reach_m = 6.0;
constexpr std::size_t max_proposals = 4;
/// The first scans find less of the map with every step: nothing is judged by fewer than these.
constexpr int min_fits_seen = 8;
/// With this share of the usual fit of all its features a scan is believed where little stands up.
constexpr double clear_fit_share = 0.85;
/// A scan of which a smaller share than this lies in known space could lie anywhere.
constexpr double min_believed_overlap = 0.1;
/// A pose whose OdometryResult::upright_fit is a smaller share than this of what they have lately
/// been is not believed. Simulated drives with hard turns fall to 0.58; scans of another city, or
/// of the wrong place in this one, reach 0.32.
constexpr double min_believed_fit_share = 0.5;
/// Share of the running mean of fits below which other starts are tried.
constexpr double min_fit_share = 0.95;
/// Weight of the newest fit in the running mean.
constexpr double fit_mean_gain = 0.1;

/// Which of two poses is the right one: the fit of what stands up, less where little of the scan
/// lies in known space.
double agreement(const OdometryResult& result) {
  constexpr double enough_overlap = 0.5;
  return result.upright_fit * std::min(1.0, result.overlap / enough_overlap);
}

/// Whether two starts have come to the same pose: a worse fit is then the scene's.
bool agree(const OdometryResult& a, const OdometryResult& b) {
  constexpr double max_distance_m = 0.03;
  constexpr double max_angle_rad = 0.003;
  if (a.health == OdometryHealth::lost || b.health == OdometryHealth::lost) return false;
  const PoseTangent difference = boxminus(a.T_map_lidar, b.T_map_lidar);
  return difference.head<3>().norm() < max_distance_m &&
         difference.tail<3>().norm() < max_angle_rad;
}

/// The best of several starts.
class BestStart {
 public:
  BestStart(const Eigen::Isometry3d& T_map_lidar_predicted, const FitStatistics& fits)
      : fits_(fits), best_(lost_at(T_map_lidar_predicted)) {}

  /// Whether the best one fits now.
  bool take(const OdometryResult& other) {
    const int iterations = best_.iterations + other.iterations;
    const bool is_found = other.health != OdometryHealth::lost;
    const bool is_better =
        best_.health == OdometryHealth::lost || agreement(other) > agreement(best_);
    if (is_found && is_better) best_ = other;
    best_.iterations = iterations;
    return fits_.fits(best_);
  }
  [[nodiscard]] const OdometryResult& result() const { return best_; }

 private:
  const FitStatistics& fits_;
  OdometryResult best_;
};

/// The motion from the first scan to the second, which may be of any speed up to 30 m/s at 10 Hz.
OdometryResult search_first_motion(const FeatureSets& features, const LocalMap& map,
                                   const RegisteredScan& last,
                                   const Eigen::Isometry3d& T_map_lidar_predicted,
                                   const OdometryConfig& config) {
  const LocalMap coarse_map = coarse_map_of_scan(last.features, last.T_map_lidar);
  const Eigen::Isometry3d T_coarse = register_features(features, coarse_map, T_map_lidar_predicted,
                                                       coarse_registration_config(config))
                                         .T_map_lidar;
  OdometryResult best = register_in_two_stages(features, map, T_coarse, config);
  // Other starts must be clearly better: streets look alike a few metres on, and where no structure
  // shows the motion along them all places fit.
  const FeatureSets some = thinned(features);
  const auto try_from = [&](const Eigen::Isometry3d& T) {
    const OdometryResult other = register_in_two_stages(some, map, T, config);
    const bool is_clear = other.health == OdometryHealth::good &&
                          agreement(other) > min_gain_of_other_start * agreement(best);
    if (is_clear) best = other;
  };
  try_from(T_map_lidar_predicted);
  for (int ring = 1; ring <= first_motion_rings; ++ring) {
    for (int k = 0; k < first_motion_directions; ++k) {
      const double bearing = 2.0 * std::numbers::pi * k / first_motion_directions;
      const double distance_m = ring * first_motion_spacing_m;
      // Along the map's axes: the lidar may be mounted tilted.
      try_from(Eigen::Translation3d(distance_m * std::cos(bearing), distance_m * std::sin(bearing),
                                    0.0) *
               T_map_lidar_predicted);
    }
  }
  if (best.health == OdometryHealth::lost) return lost_at(T_map_lidar_predicted);
  return register_features(features, map, best.T_map_lidar, config, best.sweep_correction);
}

/// Where the lidar may be after the prediction has failed.
std::vector<Eigen::Isometry3d> starts_without_prediction(const RegisteredScan& last,
                                                         const PosePrediction& prediction) {
  std::vector<Eigen::Isometry3d> starts{prediction.T_map_lidar};
  if (prediction.lost_scans == 0 && prediction.interval_s <= short_gap_s) return starts;
  starts.push_back(last.T_map_lidar);
  // Straight on during a gap.
  if (last.interval_s > 0.0 && prediction.interval_s > 0.0 && prediction.interval_s < max_gap_s)
    starts.push_back(last.T_map_lidar *
                     scaled_motion(last.motion, prediction.interval_s / last.interval_s));
  return starts;
}

}  // namespace

void FitStatistics::add(const OdometryResult& result) {
  if (result.health == OdometryHealth::lost || result.health == OdometryHealth::initialised) return;
  ++count_;
  const double gain = std::max(fit_mean_gain, 1.0 / count_);
  mean_fit_ += gain * (result.fit - mean_fit_);
  mean_upright_fit_ += gain * (result.upright_fit - mean_upright_fit_);
}

bool FitStatistics::are_known() const { return count_ >= min_fits_seen; }

bool FitStatistics::fits(const OdometryResult& result) const {
  return result.health != OdometryHealth::lost && result.fit >= min_fit_share * mean_fit_;
}

bool FitStatistics::fits_poorly(const OdometryResult& result) const {
  return result.health == OdometryHealth::lost ||
         (are_known() && result.fit < clear_fit_share * mean_fit_);
}

bool FitStatistics::believes(const OdometryResult& result) const {
  if (!are_known()) return true;
  return (believes_relocalized(result) || result.fit >= clear_fit_share * mean_fit_) &&
         result.overlap >= min_believed_overlap;
}

bool FitStatistics::believes_relocalized(const OdometryResult& result) const {
  return result.upright_fit >= min_believed_fit_share * mean_upright_fit_;
}

OdometryResult search_pose(const FeatureSets& features, const LocalMap& map,
                           const RegisteredScan& last, const PosePrediction& prediction,
                           const FitStatistics& fits, const OdometryConfig& config) {
  BestStart best(prediction.T_map_lidar, fits);
  if (prediction.is_known) {
    const OdometryResult direct = register_features(features, map, prediction.T_map_lidar, config);
    if (best.take(direct) || config.paper_exact) return best.result();
    const OdometryResult wide =
        register_in_two_stages(features, map, prediction.T_map_lidar, config);
    if (best.take(wide) || agree(direct, wide)) return best.result();
    // The motion of the last scan whatever the stamps say, and none.
    for (const Eigen::Isometry3d& T :
         {Eigen::Isometry3d(last.T_map_lidar * last.motion), last.T_map_lidar}) {
      if (best.take(register_in_two_stages(features, map, T, config))) return best.result();
    }
  }
  if (last.interval_s <= 0.0 && !config.paper_exact)
    return search_first_motion(features, map, last, prediction.T_map_lidar, config);
  const LocalMap coarse_map = coarse_map_of_scan(last.features, last.T_map_lidar);
  const OdometryConfig coarse_config = coarse_registration_config(config);
  const std::vector<Eigen::Isometry3d> starts = starts_without_prediction(last, prediction);
  for (const Eigen::Isometry3d& T : starts) {
    const OdometryResult coarse = register_features(features, coarse_map, T, coarse_config);
    if (best.take(register_in_two_stages(features, map, coarse.T_map_lidar, config))) break;
    if (starts.size() > 1 && best.take(register_in_two_stages(features, map, T, config))) break;
  }
  if (fits.fits_poorly(best.result()) && !config.paper_exact) {
    for (const Eigen::Isometry3d& T : propose_poses(features, points_of(map), last.T_map_lidar,
                                                    proposal_reach_m, max_proposals)) {
      // Only a clear one: somewhere in reach there is nearly always a place that looks a little
      // alike.
      const OdometryResult found = register_in_two_stages(features, map, T, config);
      if (fits.fits(found) && best.take(found)) break;
    }
  }
  return best.result();
}

}  // namespace stillmap
