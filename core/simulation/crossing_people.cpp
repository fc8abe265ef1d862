#include <cmath>
#include <utility>

#include "core/simulation/traffic.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

constexpr double walk_mps = 1.7;

// Across the road and back, two thirds of a step beside the way there.
std::vector<Vector2d> there_and_back(const Vector2d& middle, const Vector2d& across,
                                     double half_way_m) {
  const Vector2d side = 0.2 * Vector2d(across.y(), -across.x());
  return {middle - half_way_m * across + side, middle + half_way_m * across + side,
          middle + half_way_m * across - side, middle - half_way_m * across - side};
}

// Waits for red, walks one stage, waits for the next red.
Track cross_at_red(double stage_m, const TrafficLight& light, double delay_s, TimeSpan span) {
  Track track(span.from_s);
  double position = 0.0;
  double goal = 0.0;
  bool was_red = true;
  const auto steps = static_cast<int>(std::ceil((span.to_s - span.from_s) / Track::step_s)) + 1;
  for (int step = 0; step < steps; ++step) {
    const bool red = light.is_red(span.from_s + step * Track::step_s - delay_s);
    if (red && !was_red) goal = position + stage_m;
    was_red = red;
    const double speed = position < goal ? walk_mps : 0.0;
    track.add(position, speed);
    position = std::min(goal, position + speed * Track::step_s);
  }
  return track;
}

Vector2d leg_direction(const CityPlan& plan, const Vector2d& crossing) {
  for (const StreetPlan& street : plan.streets_along_u) {
    if (std::abs(street.position_m - crossing.y()) < 0.1) return {1, 0};
  }
  return {0, 1};
}

}  // namespace

void Traffic::add_crossing_people(Random& random) {
  const CityPlan& plan = ground_.plan();
  if (plan.crossings.empty()) return;
  const double half_way = plan.route_profile.half_road_m() + 1.1;
  // On a wide road people wait again on the median, half way.
  const double stages = plan.route_profile.half_median_m > 0.8 ? 4.0 : 2.0;
  const auto here = static_cast<std::size_t>(plan.traffic.crossing_pedestrians);
  const std::size_t each = (here + plan.crossings.size() - 1) / plan.crossings.size();
  for (std::size_t i = 0; i < here; ++i) {
    const std::size_t light = i % plan.crossings.size();
    const double slot = static_cast<double>(i / plan.crossings.size()) + 0.5;
    const Vector2d along = leg_direction(plan, plan.crossings[light]);
    const double sideways = 3.2 * (slot / static_cast<double>(each) - 0.5);
    const Vector2d across = (random.chance(0.5) ? 1.0 : -1.0) * Vector2d(-along.y(), along.x());
    Path path(ground_, there_and_back(plan.crossings[light] + sideways * along, across, half_way));
    Track track =
        cross_at_red(path.length_m() / stages, lights_[light], random.uniform(0.3, 1.2), span_);
    paths_.push_back(std::move(path));
    add_mover(random_shape(ObjectKind::person, random), paths_.size() - 1, std::move(track),
              random);
  }
}

}  // namespace stillmap::simulation
