#include "core/simulation/lane_traffic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stillmap::simulation {
namespace {

struct Mover {
  double position_m, speed_mps;
};

// Speed that the curves ahead allow, every metre of the lane.
class CurveLimit {
 public:
  CurveLimit(const Path& lane, double lateral_acceleration_mps2) : lane_(lane) {
    const auto count = static_cast<std::size_t>(lane.length_m());
    limit_mps_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double curvature = std::max(1e-4, lane.curvature(static_cast<double>(i)));
      limit_mps_[i] = std::sqrt(lateral_acceleration_mps2 / curvature);
    }
    // Twice round backwards: v^2 = v_next^2 + 2 a s.
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

// The driver model's acceleration with `gap_m` to something `ahead_mps` fast.
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

void advance(Mover& mover, double acceleration_mps2) {
  constexpr double hardest_braking_mps2 = -8.0;
  const double change = Track::step_s * std::max(acceleration_mps2, hardest_braking_mps2);
  const double speed = std::max(0.0, mover.speed_mps + change);
  mover.position_m += 0.5 * (mover.speed_mps + speed) * Track::step_s;
  mover.speed_mps = speed;
}

// Distance to the nearest red line that can still be respected.
double gap_to_red(const Path& lane, const Mover& mover, double half_length_m,
                  const std::vector<StopLine>& stops, double time_s) {
  double best = std::numeric_limits<double>::infinity();
  for (const StopLine& stop : stops) {
    if (!stop.light.is_red(time_s)) continue;
    const double gap = lane.wrapped(stop.position_m - mover.position_m) - half_length_m;
    const bool can_stop = gap > 0.0 && mover.speed_mps * mover.speed_mps < 2.0 * 4.0 * gap;
    if (can_stop && gap < 80.0) best = std::min(best, gap);
  }
  return best;
}

}  // namespace

Track::Place Track::place_at(double time_s) const {
  const double index =
      std::clamp((time_s - start_s_) / step_s, 0.0, static_cast<double>(knots_.size() - 1));
  const auto knot = std::min(static_cast<std::size_t>(index), knots_.size() - 2);
  return {knot, index - static_cast<double>(knot)};
}

double Track::position_at(double time_s) const {
  if (knots_.size() < 2) return knots_.front().position_m;
  const auto [knot, t] = place_at(time_s);
  const Knot& a = knots_[knot];
  const Knot& b = knots_[knot + 1];
  const double t2 = t * t;
  const double t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * a.position_m + (t3 - 2 * t2 + t) * step_s * a.speed_mps +
         (3 * t2 - 2 * t3) * b.position_m + (t3 - t2) * step_s * b.speed_mps;
}

double Track::speed_at(double time_s) const {
  if (knots_.size() < 2) return 0.0;
  const auto [knot, part] = place_at(time_s);
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
  std::vector<Mover> movers;
  for (const LaneUser& user : users) {
    movers.push_back(
        {user.start_m, std::min(0.6 * user.desired_speed_mps, curves.at(user.start_m))});
  }
  const auto acceleration = [&](std::size_t i, double time_s) {
    const std::size_t next = (i + 1) % users.size();
    const Mover& mover = movers[i];
    const double desired_speed_mps =
        std::min(users[i].desired_speed_mps, curves.at(mover.position_m));
    const double apart = lane.wrapped(movers[next].position_m - mover.position_m);
    const double bodies = 0.5 * (users[i].length_m + users[next].length_m);
    const double gap = next == i ? std::numeric_limits<double>::infinity() : apart - bodies;
    const double red = gap_to_red(lane, mover, 0.5 * users[i].length_m, stops, time_s);
    // The front may come closer to the line than to a vehicle.
    return std::min(idm(model, mover.speed_mps, desired_speed_mps, gap, movers[next].speed_mps),
                    idm(model, mover.speed_mps, desired_speed_mps, red + 1.5, 0.0));
  };
  const auto steps = static_cast<int>(std::ceil((span.to_s - span.from_s) / Track::step_s)) + 1;
  std::vector<double> accelerations(users.size());
  for (int step = 0; step < steps; ++step) {
    for (std::size_t i = 0; i < users.size(); ++i) {
      tracks[i].add(movers[i].position_m, movers[i].speed_mps);
      accelerations[i] = acceleration(i, span.from_s + step * Track::step_s);
    }
    for (std::size_t i = 0; i < users.size(); ++i) advance(movers[i], accelerations[i]);
  }
  return tracks;
}

}  // namespace stillmap::simulation
