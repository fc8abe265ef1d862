#include "core/planning/pose_sampler.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stillmap {
namespace {

constexpr double pi = std::numbers::pi;

/// Headings of the route, over some metres: its own steps go in eight directions only.
std::vector<PlanarPose> with_headings(const CoarseRoute& route) {
  constexpr double smoothing_m = 2.5;
  const auto reach = static_cast<std::size_t>(std::ceil(smoothing_m / route.step_m));
  std::vector<PlanarPose> poses;
  for (std::size_t i = 0; i < route.points_map.size(); ++i) {
    const Eigen::Vector2d& behind = route.points_map[i - std::min(i, reach)];
    const Eigen::Vector2d& ahead =
        route.points_map[std::min(i + reach, route.points_map.size() - 1)];
    const Eigen::Vector2d along = ahead - behind;
    poses.push_back({route.points_map[i], std::atan2(along.y(), along.x())});
  }
  return poses;
}

}  // namespace

PoseSampler::PoseSampler(const PlanningGrid& grid, const CoarseRoute& route, bool is_guided,
                         std::uint32_t seed)
    : grid_(grid), route_(with_headings(route)), is_guided_(is_guided), random_(seed) {}

PlanarPose PoseSampler::draw() {
  constexpr double beside_route = 0.7;
  constexpr double near_an_end = 0.15;
  const double kind = uniform(0.0, 1.0);
  if (!is_guided_ || kind >= beside_route + near_an_end) return draw_anywhere();
  return kind < beside_route ? draw_beside_route() : draw_near_an_end();
}

PlanarPose PoseSampler::draw_beside_route() {
  // Poses right on the route join smoothly; others get round what the route cuts close.
  constexpr double max_deviation_m = 2.0;
  constexpr double max_turn_rad = 0.5;
  const auto i = static_cast<std::size_t>(uniform(0.0, static_cast<double>(route_.size())));
  const double spread = uniform(0.0, 1.0);
  PlanarPose pose = route_[std::min(i, route_.size() - 1)];
  const double deviation_m = spread * spread * max_deviation_m;
  pose.position_map += Eigen::Vector2d(normal(deviation_m), normal(deviation_m));
  pose.heading_rad += normal(spread * max_turn_rad);
  return pose;
}

PlanarPose PoseSampler::draw_near_an_end() {
  constexpr double deviation_m = 6.0;
  const PlanarPose& end = uniform(0.0, 1.0) < 0.5 ? route_.front() : route_.back();
  return {end.position_map + Eigen::Vector2d(normal(deviation_m), normal(deviation_m)),
          uniform(-pi, pi)};
}

PlanarPose PoseSampler::draw_anywhere() {
  // Of a map most is no place to stand; a search can do with a useless pose now and then.
  constexpr int max_tries = 200;
  const Eigen::AlignedBox2d& box_map = grid_.bounds_map();
  PlanarPose pose;
  for (int i = 0; i < max_tries; ++i) {
    pose.position_map = {uniform(box_map.min().x(), box_map.max().x()),
                         uniform(box_map.min().y(), box_map.max().y())};
    if (grid_.may_stand_in(grid_.cell_of(pose.position_map))) break;
  }
  pose.heading_rad = uniform(-pi, pi);
  return pose;
}

double PoseSampler::uniform(double low, double high) {
  const double share = static_cast<double>(random_() >> 11U) * 0x1.0p-53;
  return low + share * (high - low);
}

double PoseSampler::normal(double deviation) {
  // Box and Muller.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(0.0, 1.0)));
  return deviation * radius * std::cos(2.0 * pi * uniform(0.0, 1.0));
}

}  // namespace stillmap
