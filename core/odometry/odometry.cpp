#include "core/odometry/odometry.hpp"

#include <tbb/parallel_invoke.h>

#include <cassert>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/lidar/sweep_merger.hpp"
#include "core/odometry/features.hpp"
#include "core/odometry/first_scan.hpp"
#include "core/odometry/motion_classification.hpp"
#include "core/odometry/motion_limits.hpp"
#include "core/odometry/object_clusters.hpp"
#include "core/odometry/pose_search.hpp"
#include "core/odometry/registration.hpp"
#include "core/odometry/relocalization.hpp"
#include "core/odometry/ring_start.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/scan_intervals.hpp"
#include "core/odometry/se3.hpp"
#include "core/odometry/unconfirmed_stretch.hpp"

namespace stillmap {
namespace {

/// A lost scan is looked for up to so far away, and farther by what was driven since [m].
constexpr double relocalization_reach_m = 24.0;
constexpr double max_relocalization_reach_m = 60.0;
/// Motion is classified again where the pose is farther than this from the predicted one [m, rad].
constexpr double reclassify_distance_m = 0.2;
constexpr double reclassify_angle_rad = 0.01;

}  // namespace

struct Odometry::State {
  State(const OdometryConfig& odometry_config, const SensorModel& sensor_model)
      : config(odometry_config.with_method()),
        first_config(odometry_config.at_start()),
        sensor(sensor_model),
        first_reach_m(odometry_config.first_reach_m),
        map(odometry_config.local_map),
        history(odometry_config.motion),
        intervals(sensor_model.period_s),
        is_by_surfaces(is_registered_by_surfaces(sensor, config)) {}

  /// The range image of the scan for the history; nothing where none is kept.
  [[nodiscard]] std::optional<RangeImageView> view_of(const Scan& scan, const PointLabels& labels,
                                                      const Eigen::Isometry3d& T_map_lidar) const {
    if (labels.empty() || !config.motion.use_range_image_history) return std::nullopt;
    return RangeImageView(scan, labels.classes, sensor, T_map_lidar);
  }
  [[nodiscard]] std::vector<MotionClass> classify(const ScanInParts& parts,
                                                  const Eigen::Isometry3d& T_map_lidar) const {
    if (!parts.view) return std::vector<MotionClass>(parts.objects.count, MotionClass::undecided);
    return classify_motion(parts.scan, parts.objects, T_map_lidar, history, *parts.view,
                           config.motion);
  }
  /// Whether the last velocity predicts the pose of a scan of this time.
  [[nodiscard]] bool has_velocity(std::int64_t stamp_ns) const;
  /// What scans are registered by now.
  [[nodiscard]] const OdometryConfig& method() const {
    return fits.are_known() ? config : first_config;
  }
  [[nodiscard]] bool is_searched_widely() const {
    return lost_scans == 0 || lost_scans % config.relocalization_interval == 1;
  }
  /// The IMU's rotation once the first scans have told the velocity; before that the first scan is
  /// straightened without it. The paper has none.
  [[nodiscard]] bool follows(const std::optional<InertialMotion>& inertial) const {
    return inertial && started && !first_scan && !config.paper_exact;
  }
  /// By the last motion since that pose, turned as the IMU says.
  [[nodiscard]] Eigen::Isometry3d motion_to_middle(
      double interval_s, const std::optional<InertialMotion>& inertial) const;
  /// Where a scan is, by a prior or the map's origin, else by the last motion.
  [[nodiscard]] PosePrediction predict(std::int64_t time_ns,
                                       const std::optional<Eigen::Isometry3d>& T_map_lidar_known,
                                       bool is_prior,
                                       const std::optional<InertialMotion>& inertial) const;
  /// Finds features, objects and the range image of a scan, and what its objects do, seen from the
  /// predicted pose.
  void take_apart(ScanInParts& parts, const PosePrediction& prediction) const;
  /// The pose, and the features that it was found by: few of them where these fit.
  [[nodiscard]] OdometryResult find_pose(ScanInParts& parts, const PosePrediction& prediction,
                                         FeatureSets& features) const;
  /// Classifies what moves at the registered pose where the predicted one was far from it, and
  /// registers again without that.
  void reclassify_motion(ScanInParts& parts, const Eigen::Isometry3d& T_map_lidar_predicted,
                         FeatureSets& features, OdometryResult& result) const;
  [[nodiscard]] OdometryResult estimate_pose(const FeatureSets& features,
                                             const PosePrediction& prediction) const;
  /// Asks the points for a second opinion, and the limits; the paper has neither.
  void confirm(const FeatureSets& features, const PosePrediction& prediction,
               OdometryResult& result) const {
    if (!started || config.paper_exact || result.health == OdometryHealth::lost) return;
    result = fits.are_known() ? confirmed_by_points(result, features, map, method())
                              : confirmed_at_start(result, features, map, has_prior_map, method());
    keep_to_limits(last, prediction, !has_jumped, sensor.motion_limits, result);
  }
  /// Calls a pose good only where the map says so that is older than any doubt of the place.
  void confirm_place(const FeatureSets& features, const PosePrediction& prediction,
                     OdometryResult& result);
  /// Takes this scan for the first one where no other could be registered to that.
  void begin_anew(const FeatureSets& features, OdometryResult& result);
  /// Local map and velocity as they were before the stretch.
  void forget_stretch();
  /// To the covariance of a pose that is not confirmed.
  void add_drift(std::int64_t time_ns, const PosePrediction& prediction, OdometryResult& result);
  [[nodiscard]] SweepPrior sweep_prior(std::int64_t time_ns, const SweepTimes& sweep,
                                       const SweepMotion& motion) const {
    if (!started) return {};
    return last.sweep_prior(intervals.since_last_s(time_ns), sweep, motion);
  }
  void extend_map(const ScanInParts& parts, const Step& step,
                  const Eigen::Isometry3d& T_map_middle);
  /// Keeps a scan of a lidar of few rings, and goes on by surfaces once the first ones are known.
  void go_on_by_surfaces(const ScanInParts& parts, const Step& step);
  /// The first scan by the motion to the second, where that one rolled.
  void straighten(const FeatureSets& features, std::int64_t time_ns, const SweepTimes& sweep,
                  OdometryResult& second);
  void update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                    const Eigen::Isometry3d& T_map_lidar);

  OdometryConfig config;
  /// Until enough scans are known to judge one by.
  OdometryConfig first_config;
  SensorModel sensor;
  double first_reach_m;
  LocalMap map;
  std::optional<FirstScan> first_scan;
  /// Points of a prior map, until the first scan is registered against it.
  std::vector<LabelledPoint> prior_map;
  RangeImageHistory history;
  /// Since the place is in doubt.
  std::optional<UnconfirmedStretch> stretch;
  bool started = false;
  bool has_prior_map = false;
  /// The last motion was none of the robot: a place was found again, or a prior corrected itself.
  bool has_jumped = false;
  /// Scans in a row that could not be registered.
  int lost_scans = 0;
  ScanIntervals intervals;
  RegisteredScan last;
  FitStatistics fits;
  /// Whether scans are registered by surfaces, not by edges and planes of rings.
  bool is_by_surfaces;
  /// The scans that were not.
  RingStart ring_start;
};

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

PosePrediction Odometry::State::predict(std::int64_t time_ns,
                                        const std::optional<Eigen::Isometry3d>& T_map_lidar_known,
                                        bool is_prior,
                                        const std::optional<InertialMotion>& inertial) const {
  const double interval_s = intervals.since_last_s(time_ns);
  return {.T_map_lidar = T_map_lidar_known
                             ? *T_map_lidar_known
                             : last.T_map_lidar * motion_to_middle(interval_s, inertial),
          .interval_s = interval_s,
          .is_known = is_prior || has_velocity(time_ns),
          .is_prior = is_prior,
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
    return relocalize(features, prior_map, map, prediction.T_map_lidar, method(),
                      is_searched_widely() ? first_reach_m : 0.0);
  }
  // Until the place is known, few features tell it sooner.
  OdometryResult found = search_pose(lost_scans > 0 ? downsampled(features) : features, map, last,
                                     prediction, fits, method());
  if (lost_scans > 0 && found.health != OdometryHealth::lost)
    found = register_features(features, map, found.T_map_lidar, method(), found.sweep_correction);
  const bool is_believed = prediction.is_known || !fits.are_known()
                               ? fits.believes(found)
                               : fits.believes_relocalized(found);
  if (found.health != OdometryHealth::lost && is_believed) return found;
  if (is_foretold(found, features, map, prediction, fits, config)) {
    found.health = OdometryHealth::degenerate;
    return found;
  }
  if (lost_scans > 0 && is_searched_widely()) {
    const double driven_m = last.speed_m_s() * prediction.interval_s;
    const OdometryResult again =
        relocalize(features, points_of(map), map, prediction.T_map_lidar, method(),
                   std::min(relocalization_reach_m + driven_m, max_relocalization_reach_m));
    if (fits.believes_relocalized(again)) return again;
  }
  return lost_at(prediction.T_map_lidar);
}

void Odometry::State::take_apart(ScanInParts& parts, const PosePrediction& prediction) const {
  const auto find_features = [&] {
    if (!is_by_surfaces) {
      parts.features = extract_features(parts.scan, config.features);
      return;
    }
    parts.features = extract_surfaces(parts.scan, config.features);
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
    last.interval_s = interval_s;
    intervals.add(stamp_ns);
  } else {
    intervals.begin(stamp_ns);
  }
  started = true;
  prior_map = {};
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
  const double interval_s = intervals.stamped_since_last_s(time_ns);
  if (second.health == OdometryHealth::lost || interval_s > max_prediction_s || !features.rolling)
    return;
  straighten_first_scan(first, features, interval_s, sweep, method(), map, last, second);
}

void Odometry::State::confirm_place(const FeatureSets& features, const PosePrediction& prediction,
                                    OdometryResult& result) {
  if (config.paper_exact || !fits.are_known()) return;
  if (result.health == OdometryHealth::lost) {
    // What the stretch has brought did not help: it is looked for in what was known before.
    if (stretch && lost_scans > 0) forget_stretch();
    if (stretch && !stretch->has_jumped()) result.map_entry = MapEntry::stays_out;
    return;
  }
  const bool is_jump = !prediction.is_known;
  const bool is_doubtful =
      is_jump || (result.health == OdometryHealth::degenerate && !prediction.is_prior);
  if (!stretch && !is_doubtful) return;
  if (!stretch) stretch.emplace(UnconfirmedStretch::Trusted{map, last, intervals, fits});
  if (is_jump) {
    const double distance_m = distance_from_expected(result.T_map_lidar, last, prediction);
    if (!is_followed(distance_m, prediction)) stretch->jump(distance_m);
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
  forget_stretch();
  result = lost_at(last.T_map_lidar);
}

void Odometry::State::begin_anew(const FeatureSets& features, OdometryResult& result) {
  const bool has_first_alone = started && last.interval_s <= 0.0 && !has_prior_map;
  const bool is_lost_again = lost_scans > 0 && result.health == OdometryHealth::lost;
  if (!has_first_alone || !is_lost_again || !can_begin_map(features, config)) return;
  map.clear();
  history = RangeImageHistory(config.motion);
  ring_start.clear();
  first_scan.reset();
  started = false;
  result = OdometryResult{.T_map_lidar = last.T_map_lidar};
}

void Odometry::State::forget_stretch() {
  UnconfirmedStretch::Trusted trusted = stretch->take_trusted();
  map = std::move(trusted.map);
  fits = trusted.fits;
  last = std::move(trusted.last);
  intervals = trusted.intervals;
  history = RangeImageHistory(config.motion);
  ring_start.clear();
  stretch.reset();
}

void Odometry::State::add_drift(std::int64_t time_ns, const PosePrediction& prediction,
                                OdometryResult& result) {
  if (!started) return;
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

void Odometry::State::go_on_by_surfaces(const ScanInParts& parts, const Step& step) {
  if (is_by_surfaces || config.paper_exact || has_prior_map || first_scan) return;
  ScanInParts again{.scan = parts.scan,
                    .sweep = parts.sweep,
                    .labels = parts.labels,
                    .features = extract_surfaces(parts.scan, config.features),
                    .objects = parts.objects,
                    .motion_classes = parts.motion_classes,
                    .sparse_rings = has_sparse_rings(sensor)};
  FeatureSets registered = registered_features(again, config);
  FeatureSets latest = registered;
  ring_start.add(std::move(registered), map_features(again, step.motion, config),
                 step.T_map_lidar_middle);
  if (stretch || !fits.are_known() || !ring_start.is_complete()) return;
  auto by_surfaces = ring_start.by_surfaces(config);
  map = std::move(by_surfaces.map);
  fits = by_surfaces.fits;
  last.features = std::move(latest);
  ring_start.clear();
  is_by_surfaces = true;
}

Odometry::Odometry(const OdometryConfig& config, const SensorModel& sensor)
    : state_(std::make_unique<State>(config, sensor)) {
  if (const std::string faults = config.faults(); !faults.empty())
    throw std::invalid_argument(faults);
}

Odometry::~Odometry() = default;
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;

Eigen::Isometry3d Odometry::predict(std::int64_t stamp_ns,
                                    const std::optional<InertialMotion>& inertial) const {
  if (!state_->started) return Eigen::Isometry3d::Identity();
  const double interval_s = state_->intervals.stamped_since_last_s(stamp_ns);
  return state_->last.T_map_lidar * state_->motion_to_middle(interval_s, inertial);
}

SweepMotion Odometry::sweep_motion(const SweepTimes& sweep,
                                   const std::optional<InertialMotion>& inertial) const {
  const Eigen::Isometry3d T_start_end = motion_during(sweep.duration_s);
  if (!state_->follows(inertial)) return SweepMotion(T_start_end);
  return {twist_of(T_start_end).head<3>(), inertial->R_middle_at};
}

Eigen::Isometry3d Odometry::motion_during(double period_s) const {
  return state_->last.motion_during(period_s);
}

bool Odometry::uses_rings() const {
  return !is_registered_by_surfaces(state_->sensor, state_->config);
}

Odometry::Step Odometry::register_scan(Scan& scan, const SweepTimes& sweep,
                                       const PointLabels& labels,
                                       const std::optional<Eigen::Isometry3d>& T_map_lidar_prior,
                                       const std::optional<InertialMotion>& inertial) {
  assert(labels.empty() || labels.classes.size() == scan.size());
  State& state = *state_;
  const std::int64_t time_ns = scan.stamp_ns + std::llround(sweep.middle_s * 1e9);
  const SweepMotion expected_motion = sweep_motion(sweep, inertial);
  const auto T_middle_stamp = [&] {
    return motion_to_stamp(sweep, expected_motion,
                           state.last.motion_during(std::abs(sweep.middle_s)));
  };
  std::optional<Eigen::Isometry3d> T_map_middle_known = T_map_lidar_prior;
  if (!state.started && !T_map_lidar_prior) T_map_middle_known = Eigen::Isometry3d::Identity();
  if (T_map_middle_known) *T_map_middle_known = *T_map_middle_known * T_middle_stamp().inverse();
  const PosePrediction prediction =
      state.predict(time_ns, T_map_middle_known, T_map_lidar_prior.has_value(), inertial);

  // Features F_e and F_p, without those on objects that may be moving.
  ScanInParts parts{.scan = scan, .sweep = sweep, .labels = labels};
  state.take_apart(parts, prediction);
  parts.sparse_rings = state.is_by_surfaces && has_sparse_rings(state.sensor);
  parts.sweep_prior = state.sweep_prior(time_ns, sweep, expected_motion);

  // Pose against the local map, eq. (5)-(13), at the middle of the sweep.
  Step step;
  FeatureSets features;
  step.result = state.find_pose(parts, prediction, features);
  state.reclassify_motion(parts, prediction.T_map_lidar, features, step.result);
  state.confirm(features, prediction, step.result);
  state.confirm_place(features, prediction, step.result);
  state.begin_anew(features, step.result);
  step.result = doubted_where_pulled(step.result, features, state.map, state.config);
  state.straighten(features, time_ns, sweep, step.result);
  step.T_map_lidar_middle = step.result.T_map_lidar;
  const Eigen::Isometry3d T_correction = motion_of(step.result.sweep_correction);
  deskew_to_middle(scan, sweep, T_correction);
  // Moving points stay out of the local map, eq. (9) and c > c_th.
  step.motion = classify_point_motion(scan, labels, parts.objects, parts.motion_classes,
                                      step.T_map_lidar_middle, state.map, state.config);
  const bool is_lost = step.result.health == OdometryHealth::lost;
  if (!step.result.is_confirmed()) state.add_drift(time_ns, prediction, step.result);
  state.lost_scans = is_lost ? state.lost_scans + 1 : 0;
  if (!is_lost) {
    state.extend_map(parts, step, step.T_map_lidar_middle);
    state.fits.add(step.result);
    state.update_state(time_ns, std::move(parts.view), step.T_map_lidar_middle);
    state.last.features = std::move(features);
    state.go_on_by_surfaces(parts, step);
  }

  // What users see is at the stamp: points and pose go there from the middle of the sweep.
  if (sweep.middle_s != 0.0) {
    const double stamp_part = sweep.duration_s > 0.0 ? -sweep.middle_s / sweep.duration_s : 0.0;
    const Eigen::Isometry3d T = scaled_motion(T_correction, stamp_part) * T_middle_stamp();
    move_points(scan, T.inverse());
    step.result.T_map_lidar = step.result.T_map_lidar * T;
  }
  scan.time_offset_s.clear();
  return step;
}

void Odometry::add_prior_map(std::span<const LabelledPoint> points_map) {
  State& state = *state_;
  insert_prior_map(points_map, state.map);
  state.has_prior_map |= !points_map.empty();
  if (state.stretch) state.stretch->add_prior_map(points_map);
  if (!state.started) state.prior_map.assign(points_map.begin(), points_map.end());
}

void Odometry::begin_in(PriorMap prior) {
  State& state = *state_;
  assert(!state.started && state.map.points.size() == 0);
  state.has_prior_map = !prior.points_map.empty();
  state.map = std::move(prior.local_map);
  state.prior_map = std::move(prior.points_map);
}

void Odometry::reset() { *state_ = State(state_->first_config, state_->sensor); }

void Odometry::begin_map(const std::optional<double>& reach_m) {
  State& state = *state_;
  State next(state.first_config, state.sensor);
  if (reach_m) next.first_reach_m = *reach_m;
  const bool has_velocity = state.last.interval_s > 0.0 && state.lost_scans == 0;
  if (has_velocity && !state.has_jumped && !state.stretch) {
    next.last.motion = state.last.motion;
    next.last.interval_s = state.last.interval_s;
    next.intervals = state.intervals;
  }
  state = std::move(next);
}

void Odometry::expect_first_scan(std::int64_t stamp_ns) {
  State& state = *state_;
  if (state.started || state.last.interval_s <= 0.0) return;
  const double since_last_s = state.intervals.stamped_since_last_s(stamp_ns);
  if (since_last_s > 0.0 && since_last_s <= max_prediction_s) return;
  state.last = {};
  state.intervals = ScanIntervals(state.sensor.period_s);
}

}  // namespace stillmap
