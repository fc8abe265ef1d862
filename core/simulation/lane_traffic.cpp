#include "core/simulation/lane_traffic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

constexpr double step_m = 0.25;

Vector2d right_of(const Vector2d& along) { return {along.y(), -along.x()}; }

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Points along the closed polygon, `step_m` apart in the map frame.
std::vector<Vector2d> resample(const GroundShape& ground, const std::vector<Vector2d>& corners) {
  std::vector<Vector2d> fine;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector2d way = corners[(i + 1) % corners.size()] - corners[i];
    const int pieces = std::max(1, static_cast<int>(std::ceil(way.norm() / 0.1)));
    for (int k = 0; k < pieces; ++k) fine.push_back(corners[i] + way * k / pieces);
  }
  std::vector<double> arc{0.0};
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const Vector2d& next = fine[(i + 1) % fine.size()];
    arc.push_back(arc.back() + (ground.to_map(next) - ground.to_map(fine[i])).norm());
  }
  const auto count = static_cast<std::size_t>(std::lround(arc.back() / step_m));
  std::vector<Vector2d> out;
  std::size_t at = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = arc.back() * static_cast<double>(i) / static_cast<double>(count);
    while (arc[at + 1] <= wanted) ++at;
    const double part = (wanted - arc[at]) / (arc[at + 1] - arc[at]);
    out.push_back(fine[at] + part * (fine[(at + 1) % fine.size()] - fine[at]));
  }
  return out;
}

struct MotionState {
  double position_m, speed_mps;
};

// Highest speed that this and the following curves allow, for every metre of the lane.
class CurveLimit {
 public:
  CurveLimit(const Path& lane, double lateral_acceleration_mps2) : lane_(lane) {
    const auto count = static_cast<std::size_t>(lane.length_m());
    limit_mps_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double curvature = std::max(1e-4, lane.curvature(static_cast<double>(i)));
      limit_mps_[i] = std::sqrt(lateral_acceleration_mps2 / curvature);
    }
    // Two rounds backwards, since the lane is closed: v^2 <= v_next^2 + 2 a s with s = 1 m.
    constexpr double braking_mps2 = 0.9;
    for (std::size_t k = 2 * count; k-- > 0;) {
      const double next = limit_mps_[(k + 1) % count];
      double& here = limit_mps_[k % count];
      here = std::min(here, std::sqrt(next * next + 2.0 * braking_mps2));
    }
  }

  [[nodiscard]] double at(double position_m) const {
    const auto index = static_cast<std::size_t>(lane_.wrapped(position_m));
    return limit_mps_[std::min(index, limit_mps_.size() - 1)];
  }

 private:
  const Path& lane_;
  std::vector<double> limit_mps_;
};

// Acceleration of the driver model, `gap_m` behind something that moves at `ahead_mps`.
double idm(const DriverModel& model, double speed, double desired_speed_mps, double gap_m,
           double ahead_mps) {
  const double closing =
      speed * (speed - ahead_mps) / (2.0 * std::sqrt(model.acceleration_mps2 * model.braking_mps2));
  const double wanted_gap =
      model.standstill_gap_m + std::max(0.0, speed * model.headway_s + closing);
  const double free = 1.0 - std::pow(speed / desired_speed_mps, 4);
  const double follow = std::pow(wanted_gap / std::max(gap_m, 0.1), 2);
  return model.acceleration_mps2 * (free - follow);
}

void advance(MotionState& state, double acceleration_mps2) {
  constexpr double hardest_braking_mps2 = -8.0;
  const double change = Track::step_s * std::max(acceleration_mps2, hardest_braking_mps2);
  const double speed = std::max(0.0, state.speed_mps + change);
  state.position_m += 0.5 * (state.speed_mps + speed) * Track::step_s;
  state.speed_mps = speed;
}

// Distance to the nearest stop line that is red and can still be obeyed.
double gap_to_red(const Path& lane, const MotionState& state, double half_length_m,
                  const std::vector<StopLine>& stops, double time_s) {
  double best = std::numeric_limits<double>::infinity();
  for (const StopLine& stop : stops) {
    if (!stop.light.is_red(time_s)) continue;
    const double gap = lane.wrapped(stop.position_m - state.position_m) - half_length_m;
    const bool can_stop = gap > 0.0 && state.speed_mps * state.speed_mps < 2.0 * 4.0 * gap;
    if (can_stop && gap < 80.0) best = std::min(best, gap);
  }
  return best;
}

}  // namespace

Path::Path(const GroundShape& ground, const std::vector<Vector2d>& corners_plan) {
  const std::vector<Vector2d> points = resample(ground, corners_plan);
  const std::size_t n = points.size();
  const auto map = [&](std::size_t i) { return ground.to_map(points[i % n]); };
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2d before = map(i) - map(i + n - 4);
    const Vector2d after = map(i + 4) - map(i);
    const double angle = std::abs(std::atan2(cross(before, after), before.dot(after)));
    const double arc = 0.5 * (before.norm() + after.norm());
    length_m_ += (map(i + 1) - map(i)).norm();
    samples_.push_back(
        {points[i], (points[(i + 1) % n] - points[(i + n - 1) % n]).normalized(), angle / arc});
  }
}

double Path::wrapped(double position_m) const {
  const double rest = std::fmod(position_m, length_m_);
  return rest < 0.0 ? rest + length_m_ : rest;
}

Path::Spot Path::at(double position_m) const {
  const std::size_t n = samples_.size();
  const double index = wrapped(position_m) / length_m_ * static_cast<double>(n);
  const auto low = std::min(static_cast<std::size_t>(index), n - 1);
  const double part = index - static_cast<double>(low);
  const Sample& a = samples_[low];
  const Sample& b = samples_[(low + 1) % n];
  const Vector2d along = (1.0 - part) * a.along_plan + part * b.along_plan;
  return {(1.0 - part) * a.plan + part * b.plan, std::atan2(along.y(), along.x())};
}

double Path::curvature(double position_m) const {
  const double index = wrapped(position_m) / length_m_ * static_cast<double>(samples_.size());
  return samples_[std::min(static_cast<std::size_t>(index), samples_.size() - 1)].curvature;
}

double Path::nearest(const Vector2d& spot_plan) const {
  const auto best = std::ranges::min_element(
      samples_, {}, [&](const Sample& sample) { return (sample.plan - spot_plan).squaredNorm(); });
  return length_m_ * static_cast<double>(best - samples_.begin()) /
         static_cast<double>(samples_.size());
}

Path route_path(const GroundShape& ground, bool reversed, double offset_m,
                std::optional<double> turn_radius_m) {
  std::vector<Vector2d> corners = ground.plan().route;
  if (reversed) std::ranges::reverse(corners);
  const std::size_t n = corners.size();
  std::vector<Vector2d> points;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2d in = (corners[i] - corners[(i + n - 1) % n]).normalized();
    const Vector2d out = (corners[(i + 1) % n] - corners[i]).normalized();
    const Vector2d corner = corners[i] + offset_m * (right_of(in) + right_of(out));
    const double to_left = cross(in, out);
    const double radius = turn_radius_m.value_or(ground.plan().turn_radius_m + to_left * offset_m);
    const Vector2d centre = corner - radius * in + radius * out;
    // Plain cities keep the coarse turns that figures were measured in: 3.75 degrees at a time.
    const int pieces = ground.plan().many_shapes ? 240 : 24;
    for (int k = 0; k <= pieces; ++k) {
      const double turn = 0.5 * std::numbers::pi * k / pieces;
      points.push_back(centre + radius * (std::sin(turn) * in - std::cos(turn) * out));
    }
  }
  return {ground, points};
}

Track::Segment Track::segment_at(double time_s) const {
  const double index =
      std::clamp((time_s - start_s_) / step_s, 0.0, static_cast<double>(knots_.size() - 1));
  const auto knot = std::min(static_cast<std::size_t>(index), knots_.size() - 2);
  return {knot, index - static_cast<double>(knot)};
}

double Track::position_at(double time_s) const {
  if (knots_.size() < 2) return knots_.front().position_m;
  const auto [knot, t] = segment_at(time_s);
  const Knot& a = knots_[knot];
  const Knot& b = knots_[knot + 1];
  const double t2 = t * t;
  const double t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * a.position_m + (t3 - 2 * t2 + t) * step_s * a.speed_mps +
         (3 * t2 - 2 * t3) * b.position_m + (t3 - t2) * step_s * b.speed_mps;
}

double Track::speed_at(double time_s) const {
  if (knots_.size() < 2) return 0.0;
  const auto [knot, part] = segment_at(time_s);
  return (1.0 - part) * knots_[knot].speed_mps + part * knots_[knot + 1].speed_mps;
}

bool TrafficLight::is_red(double time_s) const {
  const double phase = std::fmod(time_s + offset_s, period_s);
  return (phase < 0.0 ? phase + period_s : phase) < red_s;
}

std::vector<Track> drive_lane(const Path& lane, const std::vector<LaneUser>& users,
                              const std::vector<StopLine>& stops, const DriverModel& model,
                              TimeSpan span) {
  const CurveLimit curves(lane, model.lateral_acceleration_mps2);
  std::vector<Track> tracks(users.size(), Track(span.from_s));
  std::vector<MotionState> states;
  for (const LaneUser& user : users) {
    states.push_back(
        {user.start_m, std::min(0.6 * user.desired_speed_mps, curves.at(user.start_m))});
  }
  const auto acceleration = [&](std::size_t i, double time_s) {
    const std::size_t next = (i + 1) % users.size();
    const MotionState& state = states[i];
    const double desired_speed_mps =
        std::min(users[i].desired_speed_mps, curves.at(state.position_m));
    const double apart = lane.wrapped(states[next].position_m - state.position_m);
    const double bodies = 0.5 * (users[i].length_m + users[next].length_m);
    const double gap = next == i ? std::numeric_limits<double>::infinity() : apart - bodies;
    const double red = gap_to_red(lane, state, 0.5 * users[i].length_m, stops, time_s);
    // A stop line allows a smaller standstill gap than a vehicle.
    return std::min(idm(model, state.speed_mps, desired_speed_mps, gap, states[next].speed_mps),
                    idm(model, state.speed_mps, desired_speed_mps, red + 1.5, 0.0));
  };
  const auto steps = static_cast<int>(std::ceil((span.to_s - span.from_s) / Track::step_s)) + 1;
  std::vector<double> accelerations(users.size());
  for (int step = 0; step < steps; ++step) {
    for (std::size_t i = 0; i < users.size(); ++i) {
      tracks[i].add(states[i].position_m, states[i].speed_mps);
      accelerations[i] = acceleration(i, span.from_s + step * Track::step_s);
    }
    for (std::size_t i = 0; i < users.size(); ++i) advance(states[i], accelerations[i]);
  }
  return tracks;
}

}  // namespace stillmap::simulation
