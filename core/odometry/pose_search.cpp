#include "core/odometry/pose_search.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/odometry/expected_poses.hpp"
#include "core/odometry/faint_shifts.hpp"
#include "core/odometry/point_alignment.hpp"
#include "core/odometry/relocalization.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/telling_points.hpp"

namespace stillmap {
namespace {

/// Starts round a pose that may be far off: rings of this many directions [m].
constexpr std::size_t alignment_rings = 2;
constexpr std::size_t alignment_directions = 8;
constexpr double alignment_spacing_m = 1.5;
constexpr int rough_iterations = 20;
constexpr std::size_t rough_points = 300;
constexpr double min_gain_of_other_start = 1.01;
/// A pose that the alignment of points moves by more than this is not confirmed [m, rad].
constexpr double max_point_deviation_m = 0.2;
constexpr double max_point_deviation_rad = 0.035;
/// The same of the first scans, and how much better the points must fit elsewhere: by this share,
/// times how well the features fit.
constexpr double max_first_deviation_m = 0.1;
constexpr double max_first_deviation_rad = 0.01;
constexpr double min_first_gain = 0.25;
/// What a coarse registration, or the alignment of points, of two scans must reach to be believed.
constexpr double min_coarse_upright_fit = 0.05;
constexpr double min_fit_of_points = 0.4;
/// Either errs by up to this each time [m]: of a lidar at rest that would add up. Nor by more than
/// this [rad].
constexpr double coarse_error_m = 0.05;
constexpr double points_error_m = 0.1;
constexpr double coarse_error_rad = 0.02;
/// Both kinds of points want to go the same way where one goes this share of what the other does
/// along it, and either more than this [m].
constexpr double min_same_way = 0.5;
constexpr double min_way_m = 0.02;
/// A pose that traffic pulls by more than this is not called good [m, rad].
constexpr double max_pull_m = 0.1;
constexpr double max_pull_rad = 0.01;
/// Registration and motion agree on a pose [m, rad].
constexpr double foretold_distance_m = 0.1;
constexpr double foretold_angle_rad = 0.01;
/// Where these fail, poses so far from the last one are judged by the landmarks alone [m], and so
/// many are tried.
constexpr double proposal_reach_m = 6.0;
constexpr std::size_t max_proposals = 4;

/// Which of two poses is the right one: the fit of what stands up, less where little of the scan
/// lies in known space.
double agreement(const OdometryResult& result) {
  constexpr double enough_overlap = 0.5;
  return result.upright_fit * std::min(1.0, result.overlap / enough_overlap);
}

/// A pose with what a motion of it along the level axes of the map, and about its z, makes of
/// another one. Points are on the lidar's rings, which tilt and rise with the lidar and lie best on
/// those of the scans before where it does neither: of both, the alignment of points tells nothing.
Eigen::Isometry3d moved_level(const Eigen::Isometry3d& T_map_lidar,
                              const Eigen::Isometry3d& T_map_lidar_target) {
  PoseTangent motion = boxminus(T_map_lidar_target, T_map_lidar);
  motion.segment<3>(2).setZero();
  return boxplus(T_map_lidar, motion);
}

/// The second pose, tilted against the map's z as the first one is.
Eigen::Isometry3d with_tilt_of(const Eigen::Isometry3d& T_map_lidar,
                               const Eigen::Isometry3d& T_map_lidar_target) {
  PoseTangent motion = boxminus(T_map_lidar_target, T_map_lidar);
  motion.segment<2>(3).setZero();
  return boxplus(T_map_lidar, motion);
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

bool is_where_motion_led(const OdometryResult& found, const PosePrediction& prediction) {
  const PoseTangent off = boxminus(found.T_map_lidar, prediction.T_map_lidar);
  return off.head<3>().norm() < foretold_distance_m && off.tail<3>().norm() < foretold_angle_rad;
}

/// The best of several starts, by two witnesses: the features, and the points, whose values lie
/// nearer each other.
class BestStart {
 public:
  /// `is_first_motion`: of the second scan, whose tilt is yet to be found.
  BestStart(const Eigen::Isometry3d& T_map_lidar_predicted, bool is_first_motion,
            const FeatureSets& features, const LocalMap& map, const FitStatistics& fits,
            const OdometryConfig& config)
      : T_map_lidar_predicted_(T_map_lidar_predicted),
        is_first_motion_(is_first_motion),
        features_(features),
        map_(map),
        fits_(fits),
        in_place_{.max_iterations = 1, .without_movable = labels_tell_enough(features, config)},
        best_(lost_at(T_map_lidar_predicted)) {}

  /// Whether the best one fits now.
  bool take(const OdometryResult& other) {
    const int iterations = best_.iterations + other.iterations;
    if (other.health != OdometryHealth::lost) {
      const double score = score_of(other);
      if (best_.health == OdometryHealth::lost || score > score_) {
        best_ = other;
        score_ = score;
      }
    }
    best_.iterations = iterations;
    return fits_.fits(best_);
  }
  [[nodiscard]] const OdometryResult& result() const { return best_; }

 private:
  [[nodiscard]] double score_of(const OdometryResult& result) const {
    // One scan is all rings: features tell how the lidar tilted, points where it went.
    const Eigen::Isometry3d T_map_lidar =
        is_first_motion_ ? with_tilt_of(T_map_lidar_predicted_, result.T_map_lidar)
                         : result.T_map_lidar;
    const double fit =
        align_points(features_, map_.points, T_map_lidar, result.sweep_correction, in_place_).fit;
    const double score = agreement(result) * fit * fit;
    return is_first_motion_ ? result.fit * score : score;
  }

  Eigen::Isometry3d T_map_lidar_predicted_;
  bool is_first_motion_;
  const FeatureSets& features_;
  const LocalMap& map_;
  const FitStatistics& fits_;
  PointAlignmentConfig in_place_;
  OdometryResult best_;
  double score_ = 0.0;
};

/// Whether a scan that starts there needs no other start: it fits, or registration in two stages
/// comes to the same pose. The paper has one start.
bool is_settled_from(const Eigen::Isometry3d& T_map_lidar, const FeatureSets& features,
                     const LocalMap& map, const OdometryConfig& config, BestStart& best) {
  const OdometryResult direct = register_features(features, map, T_map_lidar, config);
  if (best.take(direct) || config.paper_exact) return true;
  const OdometryResult wide = register_in_two_stages(features, map, T_map_lidar, config);
  return best.take(wide) || agree(direct, wide);
}

/// At most so many of the points, spread evenly.
std::vector<FeaturePoint> every_nth(const std::vector<FeaturePoint>& points,
                                    std::size_t max_count) {
  const std::size_t count = std::min(points.size(), max_count);
  std::vector<FeaturePoint> some;
  some.reserve(count);
  for (std::size_t k = 0; k < count; ++k) some.push_back(points[k * points.size() / count]);
  return some;
}

/// Where the points align best, started at a pose and in rings round it.
Eigen::Isometry3d align_points_around(const FeatureSets& features, const LocalMap& map,
                                      const Eigen::Isometry3d& T_map_lidar,
                                      const OdometryConfig& config) {
  PointAlignmentConfig alignment{.without_movable = labels_tell_enough(features, config)};
  alignment.max_iterations = rough_iterations;
  FeatureSets some;
  some.points = every_nth(features.points, rough_points);
  some.level_points = every_nth(features.level_points, rough_points / 4);
  const auto aligned_from = [&](const Eigen::Isometry3d& T) {
    return align_points(some, map.points, T, {}, alignment);
  };
  std::vector<PointAlignment> aligned(1 + alignment_rings * alignment_directions);
  tbb::parallel_for(std::size_t{0}, aligned.size(), [&](std::size_t start) {
    if (start == 0) {
      aligned[start] = aligned_from(T_map_lidar);
      return;
    }
    const auto ring = static_cast<double>((start - 1) / alignment_directions + 1);
    const auto direction = static_cast<double>((start - 1) % alignment_directions);
    const double bearing = 2.0 * std::numbers::pi * direction / alignment_directions;
    const double distance_m = ring * alignment_spacing_m;
    // Along the map's axes: the lidar may be mounted tilted.
    aligned[start] = aligned_from(
        Eigen::Translation3d(distance_m * std::cos(bearing), distance_m * std::sin(bearing), 0.0) *
        T_map_lidar);
  });
  const PointAlignment* best = aligned.data();
  // Where no structure shows the motion along a street all places on it fit alike.
  for (const PointAlignment& other : aligned)
    if (other.fit > min_gain_of_other_start * best->fit) best = &other;
  return best->T_map_lidar;
}

/// The motion from the first scan to the second, which may be of any speed up to 40 m/s at 10 Hz,
/// by the alignment of points: the features of two sparse scans alone may agree on a wrong one.
void search_first_motion(const FeatureSets& features, const LocalMap& map,
                         const RegisteredScan& last, const Eigen::Isometry3d& T_map_lidar_predicted,
                         const OdometryConfig& config, BestStart& best) {
  const Eigen::Isometry3d T_aligned =
      align_points_around(features, map, T_map_lidar_predicted, config);
  const LocalMap coarse_map = coarse_map_of_scan(last.features, last.T_map_lidar);
  const Eigen::Isometry3d T_coarse = register_features(features, coarse_map, T_map_lidar_predicted,
                                                       coarse_registration_config(config))
                                         .T_map_lidar;
  best.take(register_features(features, map, T_aligned, config));
  best.take(register_in_two_stages(features, map, T_aligned, config));
  best.take(register_in_two_stages(features, map, T_coarse, config));
}

/// A pose, and where the alignment of points comes to from there.
struct SecondOpinion {
  SecondOpinion(const OdometryResult& found, const FeatureSets& features, const LocalMap& map,
                bool without_movable)
      : pose(found),
        aligned(align_points(features, map.points, found.T_map_lidar, found.sweep_correction,
                             {.without_movable = without_movable})),
        off(boxminus(aligned.T_map_lidar, found.T_map_lidar)) {
    pose.point_deviation_m = off.head<3>();
  }
  [[nodiscard]] bool confirms() const {
    return pose.point_deviation_m.norm() < max_point_deviation_m &&
           off.tail<3>().norm() < max_point_deviation_rad;
  }

  OdometryResult pose;
  PointAlignment aligned;
  PoseTangent off;
};

bool want_the_same(const Eigen::Vector2d& way_m, const Eigen::Vector2d& other_way_m) {
  const double along_m2 = way_m.dot(other_way_m);
  const double longer_m2 = std::max(way_m.squaredNorm(), other_way_m.squaredNorm());
  return longer_m2 > min_way_m * min_way_m && along_m2 >= min_same_way * way_m.squaredNorm();
}

/// What the features say of a pose, which they do not move.
OdometryResult judged_in_place(const OdometryResult& found, const Eigen::Isometry3d& T_map_lidar,
                               const FeatureSets& features, const LocalMap& map,
                               const OdometryConfig& config) {
  OdometryConfig in_place = config;
  in_place.registration.max_iterations = 1;
  OdometryResult result =
      register_features(features, map, T_map_lidar, in_place, found.sweep_correction);
  if (result.health == OdometryHealth::lost) return found;
  result.T_map_lidar = T_map_lidar;
  result.sweep_correction = found.sweep_correction;
  result.health = OdometryHealth::degenerate;
  return result;
}

/// Whether the points align better there for where smooth walls' rings lie alone.
bool is_denied_by_telling_points(const OdometryResult& found,
                                 const Eigen::Isometry3d& T_map_lidar_other,
                                 const FeatureSets& features, const LocalMap& map) {
  return gain_of_telling_points(features, map.points, found.T_map_lidar, T_map_lidar_other,
                                found.sweep_correction) < 1.0;
}

/// A pose that features found, or where the points align clearly better, as confirmed_at_start
/// says.
OdometryResult led_by_points(const OdometryResult& found, const FeatureSets& features,
                             const LocalMap& map, const OdometryConfig& config) {
  PointAlignmentConfig alignment{.without_movable = labels_tell_enough(features, config)};
  const auto aligned_from = [&](const Eigen::Isometry3d& T_map_lidar) {
    return align_points(features, map.points, T_map_lidar, found.sweep_correction, alignment);
  };
  const PointAlignment aligned =
      aligned_from(align_points_around(features, map, found.T_map_lidar, config));
  alignment.max_iterations = 1;
  const double fit_there = aligned_from(found.T_map_lidar).fit;
  const Eigen::Isometry3d T_led = moved_level(found.T_map_lidar, aligned.T_map_lidar);
  const PoseTangent off = boxminus(T_led, found.T_map_lidar);
  const bool agrees = off.head<3>().norm() < max_first_deviation_m &&
                      off.tail<3>().norm() < max_first_deviation_rad;
  // Whether traffic pulls the features shows where nothing holds the points.
  const double min_gain = 1.0 + min_first_gain * found.fit;
  if (agrees || aligned.fit < min_gain * fit_there) return found;
  if (is_denied_by_telling_points(found, T_led, features, map)) return found;
  return judged_in_place(found, T_led, features, map, config);
}

}  // namespace

Eigen::Isometry3d RegisteredScan::motion_during(double period_s) const {
  if (interval_s <= 0.0 || period_s <= 0.0 || period_s > max_prediction_s)
    return Eigen::Isometry3d::Identity();
  return scaled_motion(motion, period_s / interval_s);
}

SweepPrior RegisteredScan::sweep_prior(double interval_to_next_s, const SweepTimes& sweep,
                                       const SweepMotion& compensated) const {
  SweepPrior prior;
  prior.T_map_lidar_last = T_map_lidar;
  if (interval_to_next_s > 0.0 && interval_to_next_s < max_prediction_s)
    prior.duration_share = std::min(1.0, sweep.duration_s / interval_to_next_s);
  prior.compensated = compensated.twist();
  prior.rotation_is_measured = compensated.rotation_is_measured();
  return prior;
}

OdometryResult confirmed_by_points(const OdometryResult& found, const FeatureSets& features,
                                   const LocalMap& map, const OdometryConfig& config) {
  // Labels may be wrong, and most points may be in motion: either kind of points will do.
  std::vector<SecondOpinion> opinions;
  for (const bool without_movable : {false, true}) {
    if (without_movable && !labels_tell_enough(features, config)) continue;
    opinions.emplace_back(found, features, map, without_movable);
    if (opinions.back().confirms()) return opinions.back().pose;
  }
  for (const SecondOpinion& opinion : opinions) {
    const OdometryResult other = register_features(features, map, opinion.aligned.T_map_lidar,
                                                   config, found.sweep_correction);
    if (other.health == OdometryHealth::lost) continue;
    const bool without_movable = &opinion != &opinions.front();
    const SecondOpinion again(other, features, map, without_movable);
    if (again.confirms() && again.aligned.fit > opinion.aligned.fit &&
        !is_denied_by_telling_points(found, other.T_map_lidar, features, map))
      return again.pose;
  }
  OdometryResult doubtful = opinions.front().pose;
  doubtful.health = OdometryHealth::degenerate;
  return doubtful;
}

OdometryResult confirmed_at_start(const OdometryResult& found, const FeatureSets& features,
                                  const LocalMap& map, bool is_start_known,
                                  const OdometryConfig& config) {
  if (is_start_known) {
    const OdometryResult confirmed = confirmed_by_points(found, features, map, config);
    if (confirmed.health == OdometryHealth::good &&
        confirmed.point_deviation_m.norm() < max_first_deviation_m)
      return confirmed;
  }
  return confirmed_by_points(led_by_points(found, features, map, config), features, map, config);
}

std::optional<Eigen::Isometry3d> pose_to_last_scan(const FeatureSets& features, const LocalMap& map,
                                                   const RegisteredScan& last,
                                                   const OdometryConfig& config) {
  const OdometryResult coarse =
      register_features(features, coarse_map_of_scan(last.features, last.T_map_lidar),
                        last.T_map_lidar, coarse_registration_config(config));
  const auto moved = [&](const Eigen::Isometry3d& T_map_lidar, double error_m) {
    const PoseTangent off = boxminus(T_map_lidar, last.T_map_lidar);
    const bool is_at_rest =
        off.head<3>().norm() < error_m && off.tail<3>().norm() < coarse_error_rad;
    return is_at_rest ? last.T_map_lidar : moved_level(last.T_map_lidar, T_map_lidar);
  };
  if (coarse.health == OdometryHealth::good && coarse.upright_fit >= min_coarse_upright_fit)
    return moved(coarse.T_map_lidar, coarse_error_m);
  const PointAlignmentConfig alignment{.without_movable = labels_tell_enough(features, config)};
  const PointAlignment aligned =
      align_points(features, map.points,
                   align_points_around(features, map, last.T_map_lidar, config), {}, alignment);
  if (!aligned.converged || aligned.fit < min_fit_of_points) return std::nullopt;
  return moved(aligned.T_map_lidar, points_error_m);
}

OdometryResult moved_where_points_agree(const OdometryResult& found, const FeatureSets& features,
                                        const LocalMap& map, const OdometryConfig& config) {
  if (!labels_tell_enough(features, config) ||
      2 * movable_points(features) < features.points.size())
    return found;
  const SecondOpinion of_all(found, features, map, /*without_movable=*/false);
  const SecondOpinion of_static(found, features, map, /*without_movable=*/true);
  if (!want_the_same(of_all.off.head<2>(), of_static.off.head<2>())) return found;
  OdometryResult moved = judged_in_place(
      found, moved_level(found.T_map_lidar, of_all.aligned.T_map_lidar), features, map, config);
  moved.point_deviation_m = found.point_deviation_m;
  moved.health = OdometryHealth::degenerate;
  return moved;
}

OdometryResult doubted_where_pulled(OdometryResult found, const FeatureSets& features,
                                    const LocalMap& map, const OdometryConfig& config) {
  if (config.registration.robust_scale_m > 0.0 || found.health != OdometryHealth::good)
    return found;
  OdometryConfig robust = config;
  robust.weighting = Weighting::geometric;
  robust.registration.robust_scale_m = RegistrationConfig{}.robust_scale_m;
  const OdometryResult other =
      register_features(features, map, found.T_map_lidar, robust, found.sweep_correction);
  const PoseTangent pull = boxminus(other.T_map_lidar, found.T_map_lidar);
  const bool stays = other.health != OdometryHealth::lost && pull.head<3>().norm() < max_pull_m &&
                     pull.tail<3>().norm() < max_pull_rad;
  if (!stays) found.health = OdometryHealth::degenerate;
  return found;
}

bool is_unvouched(const OdometryResult& found, const PosePrediction& prediction,
                  const FitStatistics& fits) {
  if (!prediction.is_known || prediction.is_prior) return false;
  if (!fits.fits_poorly(found) || fits.believes_relocalized(found)) return false;
  return !is_where_motion_led(found, prediction);
}

bool is_foretold(const OdometryResult& found, const FeatureSets& features, const LocalMap& map,
                 const PosePrediction& prediction, const FitStatistics& fits,
                 const OdometryConfig& config) {
  if (config.paper_exact || !prediction.is_known || prediction.is_prior) return false;
  if (found.health != OdometryHealth::good || !fits.believes_foretold(found)) return false;
  return is_where_motion_led(found, prediction) &&
         confirmed_by_points(found, features, map, config).health == OdometryHealth::good;
}

double score_of_first_motion(const OdometryResult& second, const FeatureSets& features,
                             const LocalMap& map, const OdometryConfig& config) {
  const PointAlignmentConfig in_place{.max_iterations = 1,
                                      .without_movable = labels_tell_enough(features, config)};
  const double points_fit =
      align_points(features, map.points, second.T_map_lidar, second.sweep_correction, in_place).fit;
  return second.fit * agreement(second) * points_fit * points_fit;
}

OdometryResult search_near_prediction(const FeatureSets& features, const LocalMap& map,
                                      const PosePrediction& prediction, const FitStatistics& fits,
                                      const OdometryConfig& config) {
  const FeatureSets some = downsampled(features);
  BestStart best(prediction.T_map_lidar, /*is_first_motion=*/false, some, map, fits, config);
  static_cast<void>(is_settled_from(prediction.T_map_lidar, some, map, config, best));
  return refined(best.result(), features, map, config);
}

OdometryResult refined(const OdometryResult& found, const FeatureSets& features,
                       const LocalMap& map, const OdometryConfig& config) {
  if (found.health == OdometryHealth::lost) return found;
  OdometryResult result =
      register_with_faint_shifts(features, map, found.T_map_lidar, config, found.sweep_correction);
  result.iterations += found.iterations;
  return result;
}

OdometryResult search_pose(const FeatureSets& features, const LocalMap& map,
                           const RegisteredScan& last, const PosePrediction& prediction,
                           const FitStatistics& fits, const OdometryConfig& config) {
  const bool is_first_motion = last.interval_s <= 0.0;
  BestStart best(prediction.T_map_lidar, is_first_motion, features, map, fits, config);
  if (prediction.is_known) {
    if (is_settled_from(prediction.T_map_lidar, features, map, config, best)) return best.result();
    // The motion of the last scan whatever the stamps say, and none.
    for (const Eigen::Isometry3d& T :
         {Eigen::Isometry3d(last.T_map_lidar * last.motion), last.T_map_lidar})
      if (best.take(register_in_two_stages(features, map, T, config))) return best.result();
  }
  if (is_first_motion && !config.paper_exact) {
    search_first_motion(features, map, last, prediction.T_map_lidar, config, best);
    return best.result();
  }
  const LocalMap coarse_map = coarse_map_of_scan(last.features, last.T_map_lidar);
  const OdometryConfig coarse_config = coarse_registration_config(config);
  const std::vector<Eigen::Isometry3d> starts = starts_without_prediction(last, prediction);
  for (const Eigen::Isometry3d& T : starts) {
    const OdometryResult coarse = register_features(features, coarse_map, T, coarse_config);
    if (best.take(register_in_two_stages(features, map, coarse.T_map_lidar, config))) break;
    if (starts.size() > 1 && best.take(register_in_two_stages(features, map, T, config))) break;
  }
  if (prediction.is_searched_widely && fits.fits_poorly(best.result()) && !config.paper_exact) {
    for (const Eigen::Isometry3d& T : starts) {
      const Eigen::Isometry3d T_aligned = align_points_around(features, map, T, config);
      if (best.take(register_features(features, map, T_aligned, config))) break;
      if (best.take(register_in_two_stages(features, map, T_aligned, config))) break;
    }
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
