#include "core/odometry/odometry.hpp"

#include <cassert>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/lidar/sweep_merger.hpp"
#include "core/odometry/faint_shifts.hpp"
#include "core/odometry/odometry_steps.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {

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
  const bool begins_by_rings = !is_registered_by_surfaces(state_->sensor, state_->config);
  return begins_by_rings || !state_->is_by_surfaces;
}

Odometry::Step Odometry::register_scan(Scan& scan, const SweepTimes& sweep,
                                       const PointLabels& labels,
                                       const std::optional<Eigen::Isometry3d>& T_map_lidar_prior,
                                       const std::optional<InertialMotion>& inertial) {
  assert(labels.empty() || labels.classes.size() == scan.size());
  State& state = *state_;
  const std::int64_t time_ns = scan.stamp_ns + std::llround(sweep.middle_s * 1e9);
  const SweepMotion expected_motion = sweep_motion(sweep, inertial);
  std::optional<Eigen::Isometry3d> T_map_middle_known = T_map_lidar_prior;
  if (!state.started && !T_map_lidar_prior) T_map_middle_known = Eigen::Isometry3d::Identity();
  if (T_map_middle_known) {
    *T_map_middle_known =
        *T_map_middle_known * state.motion_to_stamp(sweep, expected_motion, {}).inverse();
  }
  const PosePrediction prediction =
      state.predict(time_ns, T_map_middle_known, T_map_lidar_prior.has_value(), inertial);

  // Features F_e and F_p, without those on objects that may be moving.
  ScanInParts parts{.scan = scan, .sweep = sweep, .labels = labels};
  state.take_apart(parts, prediction);
  state.choose_beginning(parts, prediction);
  parts.sweep_prior = state.sweep_prior(time_ns, sweep, expected_motion);

  // Pose against the local map, eq. (5)-(13), at the middle of the sweep.
  Step step;
  FeatureSets features;
  step.result = state.find_pose(parts, prediction, features);
  state.reclassify_motion(parts, prediction.T_map_lidar, features, step.result);
  state.judge_what_could_move(parts, prediction, features, step.result);
  state.confirm(features, prediction, step.result);
  if (state.is_movable_denied && step.result.health == OdometryHealth::good)
    step.result.health = OdometryHealth::degenerate;
  state.confirm_place(features, prediction, step.result);
  state.begin_anew(features, step.result);
  step.result = doubted_where_pulled(step.result, features, state.map, state.config);
  step.result = doubted_where_shift_fits(step.result, features, state.map, state.method());
  step.result = state.flat_fit.doubted(step.result, features, state.map, state.method());
  state.straighten(features, time_ns, sweep, step.result);
  step.T_map_lidar_middle = step.result.T_map_lidar;
  move_to_middle(scan, sweep, step.result.sweep_correction);
  // Moving points stay out of the local map, eq. (9) and c > c_th.
  step.motion = classify_point_motion(scan, labels, parts.objects, parts.motion_classes,
                                      step.T_map_lidar_middle, state.map, state.config);
  const bool is_lost = step.result.health == OdometryHealth::lost;
  if (!step.result.is_confirmed()) state.add_drift(time_ns, prediction, step.result);
  state.lost_scans = is_lost ? state.lost_scans + 1 : 0;
  if (!is_lost) state.take(parts, step, time_ns, std::move(features));

  // What users see is at the stamp: points and pose go there from the middle of the sweep.
  if (sweep.middle_s != 0.0) {
    const Eigen::Isometry3d T =
        state.motion_to_stamp(sweep, expected_motion, step.result.sweep_correction);
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
  if (!state.is_by_surfaces) state.ring_start.set_prior_map(points_map);
  if (!state.started) state.prior_map.assign(points_map.begin(), points_map.end());
}

void Odometry::begin_in(PriorMap prior) {
  State& state = *state_;
  assert(!state.started && state.map.points.size() == 0);
  state.has_prior_map = !prior.points_map.empty();
  state.map = std::move(prior.local_map);
  if (!state.is_by_surfaces) state.ring_start.set_prior_map(prior.points_map);
  state.prior_map = std::move(prior.points_map);
}

void Odometry::use_sensor(const SensorModel& sensor) {
  State& state = *state_;
  state.sensor = sensor;
  state.intervals.set_period(sensor.period_s);
  const bool begins_by_surfaces = is_registered_by_surfaces(sensor, state.config);
  // A map that was begun by rings goes on by surfaces once RingStart has it from enough places.
  const bool has_rings = sensor.pattern == ScanPattern::rings;
  if (!state.started || !has_rings) state.is_by_surfaces = begins_by_surfaces;
  if (!state.started && !state.is_by_surfaces) state.ring_start.set_prior_map(state.prior_map);
}

void Odometry::set_clock(std::int64_t shift_ns) {
  state_->intervals.set_clock(shift_ns);
  if (state_->stretch) state_->stretch->set_clock(shift_ns);
  if (state_->led) state_->led->intervals.set_clock(shift_ns);
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
    next.goes_on = true;
  }
  state = std::move(next);
}

void Odometry::go_on_from(const StampedPose& before_last, const StampedPose& last) {
  State& state = *state_;
  assert(!state.started);
  if (state.last.interval_s > 0.0) return;
  const double interval_s = 1e-9 * static_cast<double>(last.stamp_ns - before_last.stamp_ns);
  if (interval_s <= 0.0 || interval_s > max_prediction_s) return;
  const RegisteredScan from{.features = {}, .T_map_lidar = before_last.T_map_lidar};
  if (!is_reachable(from, last.T_map_lidar, interval_s, false, state.sensor.motion_limits)) return;
  state.last.motion = before_last.T_map_lidar.inverse() * last.T_map_lidar;
  state.intervals = ScanIntervals(state.sensor.period_s);
  state.intervals.begin(before_last.stamp_ns);
  state.intervals.add(last.stamp_ns);
  state.last.interval_s = state.intervals.last_interval_s();
  state.intervals_are_of_stamps = true;
  state.goes_on = true;
}

void Odometry::expect_first_scan(std::int64_t stamp_ns, std::int64_t after_stamp_ns) {
  State& state = *state_;
  if (state.started || state.last.interval_s <= 0.0) return;
  if (std::exchange(state.intervals_are_of_stamps, false))
    state.intervals.set_clock(after_stamp_ns);
  const double since_last_s = state.intervals.stamped_since_last_s(stamp_ns);
  if (since_last_s > 0.0 && since_last_s <= max_prediction_s) return;
  state.last = {};
  state.intervals = ScanIntervals(state.sensor.period_s);
  state.goes_on = false;
}

}  // namespace stillmap
