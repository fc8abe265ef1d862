#include "core/odometry/odometry_steps.hpp"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/odometry/expected_poses.hpp"
#include "core/odometry/first_motion.hpp"
#include "core/odometry/object_clusters.hpp"
#include "core/odometry/relocalization.hpp"
#include "core/odometry/ring_tangents.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// No lost scan is looked for farther away than this [m].
constexpr double max_relocalization_reach_m = 60.0;
/// Motion is classified again where the pose is farther than this from the predicted one [m, rad].
constexpr double reclassify_distance_m = 0.2;
constexpr double reclassify_angle_rad = 0.01;
/// Parked objects prove that those beside them stand, too, once the lidar has moved so far since
/// they were seen first [m], and where so large a share of their points is on parked ones.
constexpr double min_proving_way_m = 0.5;
constexpr double min_parked_share = 0.05;
/// And unless a smaller share of what stands and cannot move, if there are so many points of it,
/// was seen at its place.
constexpr double min_fixed_share = 0.3;
constexpr int min_fixed_points = 5;
/// Without them the pose would be farther off than this [m, rad]: they may move.
constexpr double max_disagreement_m = 0.1;
constexpr double max_disagreement_rad = 0.01;
/// Points of a ring to either side among which its direction is sought where walls are near: 0.3 m
/// from one 2 m away, at a fifth of a degree each.
constexpr std::size_t steps_on_near_walls = 40;
/// Where fewer points stand up, the lidar is in the open. Of evenly spread ones, 800 at most,
/// motorways, bridges and lawns leave 160 to 310, streets and squares all.
constexpr std::size_t few_upright_points = 400;
/// And on smooth ground where rings have so many planes to an edge: motorways and bridges 4.3 to
/// 15, snow and lawns, whose bumps do hold the lidar, at most 2.
constexpr std::size_t smooth_planes_per_edge = 3;

/// How far off the rings of a lidar, where they are closest, lie as far apart as the neighbours of
/// a point may [m].
float surfaces_reach_m(const SensorModel& sensor, const RegistrationConfig& config) {
  if (sensor.pattern != ScanPattern::rings || sensor.rings < 2)
    return std::numeric_limits<float>::infinity();
  double ring_step_rad = std::numeric_limits<double>::infinity();
  for (int ring = 1; ring < sensor.rings; ++ring) {
    const double step_rad = std::abs(sensor.beam_elevation(ring - 1) - sensor.beam_elevation(ring));
    if (step_rad > 0.0) ring_step_rad = std::min(ring_step_rad, step_rad);
  }
  return static_cast<float>(config.max_neighbour_distance_m / ring_step_rad);
}

/// The map's z, along the lidar's axes.
Eigen::Vector3f up_along_lidar(const Eigen::Isometry3d& T_map_lidar) {
  return T_map_lidar.linear().row(2).transpose().cast<float>();
}

/// Which share of the points that stand up and cannot move the oldest range image saw at their
/// places, if the lidar is there, 0..1; nothing where hardly any tell.
std::optional<double> share_seen_before(const ScanInParts& parts, const RangeImageHistory& history,
                                        const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  int all = 0;
  int seen = 0;
  for (const std::uint32_t i : parts.features.upright_points) {
    if (parts.objects.of_point[i] != ObjectClusters::none || is_ground(parts.labels.classes[i]))
      continue;
    ++all;
    seen += history.saw_fixed_at(T * parts.scan.points_lidar[i]) ? 1 : 0;
  }
  if (all < min_fixed_points || history.is_empty()) return std::nullopt;
  return static_cast<double>(seen) / static_cast<double>(all);
}

}  // namespace

bool Odometry::State::has_velocity(std::int64_t stamp_ns) const {
  return last.interval_s > 0.0 && lost_scans == 0 &&
         intervals.since_last_s(stamp_ns) <= max_prediction_s;
}

Eigen::Isometry3d Odometry::State::motion_to_middle(
    double interval_s, const std::optional<InertialMotion>& inertial) const {
  const Eigen::Isometry3d T_last_middle = last.motion_during(interval_s);
  if (!follows(inertial)) return T_last_middle;
  PoseTangent twist = twist_of(T_last_middle);
  twist.tail<3>() = so3_log(inertial->R_last_middle);
  return motion_of(twist);
}

Eigen::Isometry3d Odometry::State::motion_to_stamp(const SweepTimes& sweep,
                                                   const SweepMotion& compensated,
                                                   const SweepCorrection& correction) const {
  const double part =
      sweep.duration_s > 0.0 ? std::clamp(-sweep.middle_s / sweep.duration_s, -0.5, 0.5) : 0.0;
  const double beyond_s = -sweep.middle_s - part * sweep.duration_s;
  const Eigen::Isometry3d T_beyond = last.motion_during(std::abs(beyond_s));
  return T_middle_at(correction, part) * compensated.T_middle_at(part) *
         (beyond_s < 0.0 ? T_beyond.inverse() : T_beyond);
}

PosePrediction Odometry::State::predict(std::int64_t time_ns,
                                        const std::optional<Eigen::Isometry3d>& T_map_lidar_known,
                                        bool is_prior,
                                        const std::optional<InertialMotion>& inertial) const {
  const double interval_s = intervals.since_last_s(time_ns);
  // A lidar that stays lost does not go back to where it was before.
  const double moved_s = lost_scans > 0 ? std::min(interval_s, max_prediction_s) : interval_s;
  return {.T_map_lidar = T_map_lidar_known ? *T_map_lidar_known
                         : led             ? led->T_map_lidar_at(time_ns)
                                           : last.T_map_lidar * motion_to_middle(moved_s, inertial),
          .interval_s = interval_s,
          .driven_m = led ? led->driven_m(time_ns) : last.speed_m_s() * interval_s,
          .is_known = is_prior || has_velocity(time_ns),
          .is_prior = is_prior,
          .is_led = led && !is_prior,
          .lost_scans = lost_scans,
          .is_searched_widely = is_searched_widely()};
}

OdometryResult Odometry::State::estimate_pose(const FeatureSets& features,
                                              const PosePrediction& prediction) const {
  if (!started) {
    if (prior_map.empty()) {
      return can_begin_map(features, config) ? OdometryResult{.T_map_lidar = prediction.T_map_lidar}
                                             : lost_at(prediction.T_map_lidar);
    }
    const OdometryResult found = relocalize(features, prior_map, map, prediction.T_map_lidar,
                                            method(), is_searched_widely() ? first_reach_m : 0.0);
    // Rings on the road, and what drives along with the lidar, lie well on where it was last, too.
    return found.health == OdometryHealth::lost || config.paper_exact
               ? found
               : confirmed_at_start(found, features, map, /*is_start_known=*/false, method());
  }
  // Few features tell the place sooner. Of the first scans all are needed.
  const bool is_rough = lost_scans > 0 || (fits.are_known() && !config.paper_exact);
  OdometryResult found = search_pose(is_rough ? downsampled(features) : features, map, last,
                                     prediction, fits, method());
  if (is_rough) found = refined(found, features, map, method());
  const bool is_believed = prediction.is_known || !fits.are_known()
                               ? fits.believes(found)
                               : fits.believes_relocalized(found);
  if (found.health != OdometryHealth::lost && is_believed) return found;
  if (is_foretold(found, features, map, prediction, fits, config)) {
    found.health = OdometryHealth::degenerate;
    return found;
  }
  if (lost_scans > 0 && is_searched_widely()) {
    const OdometryResult again = relocalize(
        features, points_of(map), map, prediction.T_map_lidar, method(),
        std::min(relocalization_reach_m + prediction.driven_m, max_relocalization_reach_m));
    if (fits.believes_relocalized(again)) return again;
  }
  return lost_at(prediction.T_map_lidar);
}

void Odometry::State::take_apart(ScanInParts& parts, const PosePrediction& prediction) const {
  parts.sparse_rings = is_by_surfaces && (has_sparse_rings(sensor) || is_map_young());
  if (!parts.scan.ring.empty())
    parts.surfaces_reach_m = surfaces_reach_m(sensor, config.registration);
  const Eigen::Vector3f up_lidar = up_along_lidar(prediction.T_map_lidar);
  const auto find_features = [&] {
    parts.features = is_by_surfaces ? extract_surfaces(parts.scan, config.features, up_lidar)
                                    : extract_features(parts.scan, config.features, up_lidar);
    if (!fits.are_known() && !parts.scan.ring.empty())
      parts.features.point_tangents =
          ring_tangents(parts.scan, parts.features.upright_points, steps_on_near_walls);
    if (!is_by_surfaces) return;
    // One that was made earlier has too few other points to go by.
    if ((fits.are_known() || !has_prior_map) && !parts.scan.ring.empty())
      parts.features.tangents = ring_tangents(parts.scan, parts.features.surfaces);
    if (prediction.is_known && fits.are_known())
      parts.few_surfaces = few_surfaces(parts.scan, config.features, parts.features);
  };
  tbb::parallel_invoke(
      find_features,
      [&] {
        parts.objects = cluster_objects(parts.scan.points_lidar, parts.labels.classes,
                                        config.motion.object_gap_m);
      },
      [&] { parts.view = view_of(parts.scan, parts.labels, prediction.T_map_lidar); });
  parts.motion_classes = classify(parts, prediction.T_map_lidar);
  find_upright_tangents(parts, config);
  parts.movable = movable;
}

void Odometry::State::choose_beginning(ScanInParts& parts, const PosePrediction& prediction) {
  if (started || is_by_surfaces || has_prior_map || config.paper_exact) return;
  const bool is_sparse = has_sparse_rings(sensor);
  if (!parts.labels.empty() || is_sparse) {
    const Features& rings = parts.features;
    if (rings.upright_points.size() >= few_upright_points) return;
    if (is_sparse && rings.planes.size() < smooth_planes_per_edge * rings.edges.size()) return;
  }
  is_by_surfaces = true;
  take_apart(parts, prediction);
}

OdometryResult Odometry::State::find_pose(ScanInParts& parts, const PosePrediction& prediction,
                                          FeatureSets& features) const {
  if (!parts.few_surfaces.empty()) {
    std::swap(parts.features.surfaces, parts.few_surfaces);
    features = registered_features(parts, config);
    const OdometryResult found = search_near_prediction(features, map, prediction, fits, method());
    if (fits.fits(found) && fits.believes(found)) return found;
    std::swap(parts.features.surfaces, parts.few_surfaces);
  }
  features = registered_features(parts, config);
  return estimate_pose(features, prediction);
}

void Odometry::State::reclassify_motion(ScanInParts& parts,
                                        const Eigen::Isometry3d& T_map_lidar_predicted,
                                        FeatureSets& features, OdometryResult& result) const {
  if (!parts.view || !started || result.health == OdometryHealth::lost) return;
  const PoseTangent off = boxminus(result.T_map_lidar, T_map_lidar_predicted);
  if (off.head<3>().norm() < reclassify_distance_m && off.tail<3>().norm() < reclassify_angle_rad)
    return;
  parts.view->move_to(result.T_map_lidar);
  parts.motion_classes = classify(parts, result.T_map_lidar);
  if (parts.movable == MovableUse::none) return;
  features = registered_features(parts, config);
  const OdometryResult again =
      register_features(features, map, result.T_map_lidar, method(), result.sweep_correction);
  if (again.health != OdometryHealth::lost) result = again;
}

void Odometry::State::update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                                   const Eigen::Isometry3d& T_map_lidar_now) {
  if (started) {
    const double interval_s = intervals.since_last_s(stamp_ns);
    has_jumped = !is_reachable(last, T_map_lidar_now, interval_s, last.interval_s > 0.0,
                               sensor.motion_limits);
    last.motion = last.T_map_lidar.inverse() * T_map_lidar_now;
    intervals.add(stamp_ns);
    last.interval_s = intervals.last_interval_s();
  } else {
    intervals.begin(stamp_ns);
  }
  started = true;
  prior_map = {};
  led.reset();
  last.T_map_lidar = T_map_lidar_now;
  if (!view) return;
  view->move_to(T_map_lidar_now);
  const auto is_gone = [&](const Eigen::Vector3f& p_map) {
    return history.sees_through(*view, p_map);
  };
  map.edges.remove_movable_if(is_gone);
  map.planes.remove_movable_if(is_gone);
  history.add(*std::move(view));
}

void Odometry::State::straighten(const FeatureSets& features, std::int64_t time_ns,
                                 const SweepTimes& sweep, OdometryResult& second) {
  if (!first_scan) return;
  const FirstScan first = *std::exchange(first_scan, std::nullopt);
  // Points have told that it rests (first_motion_by_points), which no sweep bends.
  if (second.T_map_lidar.isApprox(last.T_map_lidar)) return;
  // A rolling lidar's sweeps follow each other: stamps that say less are wrong.
  constexpr double min_sweeps = 0.9;
  const double stamped_s = intervals.stamped_since_last_s(time_ns);
  const double interval_s =
      stamped_s > min_sweeps * sweep.duration_s ? stamped_s : intervals.since_last_s(time_ns);
  if (second.health == OdometryHealth::lost || interval_s > max_prediction_s || !features.rolling)
    return;
  auto straightened =
      straighten_first_scan(first, {features, sweep, interval_s}, {map, last.T_map_lidar, second},
                            method(), sensor.motion_limits.max_speed_m_s);
  if (straightened) {
    map = std::move(straightened->map);
    last.T_map_lidar = straightened->T_map_first;
    second = straightened->second;
  }
  // A straight first scan settles doubts that a bent one raised, but not this one.
  if (is_movable_denied && second.health == OdometryHealth::good)
    second.health = OdometryHealth::degenerate;
}

void Odometry::State::confirm(const FeatureSets& features, const PosePrediction& prediction,
                              OdometryResult& result) const {
  if (!started || config.paper_exact || result.health == OdometryHealth::lost) return;
  const bool is_first_motion = last.interval_s <= 0.0 && !has_prior_map;
  std::optional<OdometryResult> first;
  if (is_first_motion && !is_by_surfaces)
    first = first_motion_by_points(result, features, map, last, method());
  result = first ? *first
           : fits.are_known()
               ? confirmed_by_points(result, features, map, method())
               : confirmed_at_start(result, features, map, has_prior_map || goes_on, method());
  if (result.health == OdometryHealth::good && fits.is_contradicted_by_points(result))
    result = moved_where_points_agree(result, features, map, method());
  if (fits.are_known() && is_unvouched(result, prediction, fits))
    result.health = OdometryHealth::degenerate;
  keep_to_limits(last, prediction, !has_jumped, sensor.motion_limits, result);
}

void Odometry::State::confirm_place(const FeatureSets& features, const PosePrediction& prediction,
                                    OdometryResult& result) {
  if (config.paper_exact || !fits.are_known()) return;
  if (result.health == OdometryHealth::lost) {
    // What the stretch has brought did not help: it is looked for in what was known before.
    // Not where that is out of reach by now, and only what lies there looks alike.
    if (stretch && lost_scans > 0 &&
        stretch->is_in_reach(result.T_map_lidar, prediction.driven_m)) {
      result.T_map_lidar = stretch->where_motion_led(result.T_map_lidar);
      forget_stretch();
    }
    if (stretch && !stretch->has_jumped()) result.map_entry = MapEntry::stays_out;
    return;
  }
  const bool is_jump = !prediction.is_known;
  const bool is_doubtful =
      is_jump || (result.health == OdometryHealth::degenerate && !prediction.is_prior);
  if (!stretch && !is_doubtful) return;
  if (!stretch) stretch.emplace(UnconfirmedStretch::Trusted{map, last, intervals, fits});
  if (is_jump) {
    const Eigen::Isometry3d T_expected = nearest_expected(result.T_map_lidar, last, prediction);
    if (!is_followed(result.T_map_lidar, T_expected, prediction))
      stretch->jump(T_expected, result.T_map_lidar);
  }
  using enum UnconfirmedStretch::Decision;
  const auto decision = stretch->evaluate(features, config, result);
  if (decision == confirmed) {
    UnconfirmedStretch::Trusted trusted = stretch->take_trusted();
    map = std::move(trusted.map);
    fits = trusted.fits;
  }
  if (decision == confirmed || decision == settled) return stretch.reset();
  result.health = OdometryHealth::degenerate;
  if (decision == open) return;
  result = lost_at(stretch->where_motion_led(result.T_map_lidar));
  forget_stretch();
}

void Odometry::State::judge_what_could_move(ScanInParts& parts, const PosePrediction& prediction,
                                            FeatureSets& features, OdometryResult& result) {
  if (!started || result.health == OdometryHealth::lost) return;
  if (parts.movable != MovableUse::not_moving) {
    is_movable_denied = false;
    return;
  }
  const std::optional<double> seen_before = share_seen_before(parts, history, result.T_map_lidar);
  if (seen_before && *seen_before < min_fixed_share) {
    // Few of the surfaces are too few without the objects: find_pose put all of them aside.
    if (parts.few_surfaces.size() > parts.features.surfaces.size())
      std::swap(parts.features.surfaces, parts.few_surfaces);
    features = fixed_or_parked_features(parts, config);
    result = estimate_pose(features, prediction);
    is_movable_denied = true;
    return;
  }
  // Seen where they were by a lidar that has moved, which one that is taken along has not.
  const double moved_m = history.distance_from_oldest_m(result.T_map_lidar.translation());
  if (seen_before && moved_m >= min_proving_way_m && parked_share(parts) >= min_parked_share) {
    is_movable_denied = false;
    return;
  }
  // A pose in doubt anyway does not tell: the denial would outlast it.
  if (is_movable_denied || result.health != OdometryHealth::good) return;
  const OdometryResult by_fixed = register_features(
      fixed_features(parts, config), map, result.T_map_lidar, method(), result.sweep_correction);
  const PoseTangent off = boxminus(by_fixed.T_map_lidar, result.T_map_lidar);
  is_movable_denied = by_fixed.health != OdometryHealth::good ||
                      off.head<3>().norm() > max_disagreement_m ||
                      off.tail<3>().norm() > max_disagreement_rad;
}

void Odometry::State::begin_anew(const FeatureSets& features, OdometryResult& result) {
  const bool has_first_alone = started && last.interval_s <= 0.0 && !has_prior_map;
  const bool is_lost_again = lost_scans > 0 && result.health == OdometryHealth::lost;
  if (!has_first_alone || !is_lost_again || !can_begin_map(features, config)) return;
  const Eigen::Isometry3d T_map_lidar =
      pose_to_last_scan(features, map, last, method()).value_or(last.T_map_lidar);
  map.clear();
  forget_objects();
  ring_start.clear();
  first_scan.reset();
  started = false;
  // Another lidar may have been told since.
  is_by_surfaces = is_registered_by_surfaces(sensor, config);
  result = OdometryResult{.T_map_lidar = T_map_lidar};
  // Nobody knows where it is to the one before, which may be in a map.
  result.map_entry = MapEntry::stays_out;
  result.covariance = unknown_pose_covariance();
}

void Odometry::State::forget_stretch() {
  led = LedSince{.T_map_lidar = stretch->where_motion_led(last.T_map_lidar),
                 .motion = has_jumped ? Eigen::Isometry3d::Identity() : last.motion,
                 .interval_s = last.interval_s,
                 .intervals = intervals};
  UnconfirmedStretch::Trusted trusted = stretch->take_trusted();
  map = std::move(trusted.map);
  fits = trusted.fits;
  fits.forget_point_deviation();
  last = std::move(trusted.last);
  intervals = trusted.intervals;
  forget_objects();
  ring_start.clear();
  stretch.reset();
}

void Odometry::State::add_drift(std::int64_t time_ns, const PosePrediction& prediction,
                                OdometryResult& result) {
  if (!started) {
    // It does not fit where the map was left, or where it was found.
    if (has_prior_map && result.health == OdometryHealth::lost)
      result.covariance = unknown_pose_covariance();
    return;
  }
  const bool is_followed =
      stretch && !stretch->has_jumped() && result.health != OdometryHealth::lost;
  const double since_s = (stretch ? stretch->trusted().intervals : intervals).since_last_s(time_ns);
  result.covariance += drift_covariance(stretch ? stretch->trusted().last : last, since_s,
                                        is_followed || prediction.is_prior);
}

void Odometry::State::extend_map(const ScanInParts& parts, const Step& step,
                                 const Eigen::Isometry3d& T_map_middle) {
  FeatureSets features = map_features(parts, step.motion, config);
  extend_local_map(map, features, T_map_middle);
  const bool is_uncompensated = last.interval_s <= 0.0;
  if (step.result.health == OdometryHealth::initialised && features.rolling && is_uncompensated)
    first_scan = {std::move(features), parts.sweep, T_map_middle};
}

void Odometry::State::take(ScanInParts& parts, const Step& step, std::int64_t time_ns,
                           FeatureSets features) {
  extend_map(parts, step, step.T_map_lidar_middle);
  fits.add(step.result);
  update_state(time_ns, std::move(parts.view), step.T_map_lidar_middle);
  last.features = std::move(features);
  movable = parts.movable;
  go_on_by_surfaces(parts, step);
}

void Odometry::State::go_on_by_surfaces(const ScanInParts& parts, const Step& step) {
  if (is_by_surfaces || config.paper_exact || first_scan) return;
  ScanInParts again{.scan = parts.scan,
                    .sweep = parts.sweep,
                    .labels = parts.labels,
                    .features = extract_surfaces(parts.scan, config.features,
                                                 up_along_lidar(step.T_map_lidar_middle)),
                    .objects = parts.objects,
                    .motion_classes = parts.motion_classes,
                    .sparse_rings = has_sparse_rings(sensor),
                    .movable = parts.movable};
  find_upright_tangents(again, config);
  // As this scan was registered: what was found to move stays out.
  FeatureSets registered = parts.movable == MovableUse::not_moving
                               ? registered_features(again, config)
                               : fixed_or_parked_features(again, config);
  FeatureSets latest = registered;
  ring_start.add(std::move(registered), map_features(again, step.motion, config),
                 step.T_map_lidar_middle);
  if (stretch || !fits.are_known() || !ring_start.is_complete()) return;
  auto by_surfaces = ring_start.by_surfaces(config);
  map = std::move(by_surfaces.map);
  fits = by_surfaces.fits;
  last.features = std::move(latest);
  ring_start = {};
  is_by_surfaces = true;
}

}  // namespace stillmap
