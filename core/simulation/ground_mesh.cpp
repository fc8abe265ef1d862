#include "core/simulation/ground_mesh.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap::simulation {
namespace {

constexpr double cell_m = 1.25;

// All positions at which the cross-section of a street changes, on one axis of the plan.
std::vector<double> break_lines(const std::vector<StreetPlan>& streets, double low, double high) {
  std::vector<double> lines{low, high};
  for (const auto& [position, profile] : streets) {
    const double half_road = profile.half_road_m();
    for (const double offset :
         {profile.half_median_m, profile.half_driven_m(), half_road, half_road + profile.verge_m,
          profile.half_street_m(), half_road + 4.0, half_road + 7.0}) {
      lines.push_back(position - offset);
      lines.push_back(position + offset);
    }
  }
  std::ranges::sort(lines);
  return lines;
}

std::vector<double> subdivide(const std::vector<double>& lines) {
  std::vector<double> out{lines.front()};
  for (const double line : lines) {
    const double gap = line - out.back();
    if (gap < 1e-3) continue;
    const int steps = static_cast<int>(std::ceil(gap / cell_m));
    const double from = out.back();
    for (int i = 1; i <= steps; ++i) out.push_back(from + gap * i / steps);
  }
  return out;
}

std::vector<double> axis_lines(const std::vector<StreetPlan>& streets, double margin) {
  const auto [low, high] = std::ranges::minmax(streets, {}, &StreetPlan::position_m);
  return subdivide(break_lines(streets, low.position_m - margin, high.position_m + margin));
}

Surface surface_of(Zone zone, const CityPlan& plan) {
  switch (zone) {
    case Zone::road:
      return Surface::asphalt;
    case Zone::parking:
      return Surface::parking_bay;
    case Zone::sidewalk:
      return Surface::pavement;
    case Zone::other:
      return Surface::gravel;
    case Zone::median:
      return plan.paved_medians ? Surface::gravel : Surface::grass;
    default:
      return Surface::grass;
  }
}

// Roads without a sidewalk end in grass, not at a kerb of stone.
bool is_country_edge(Zone left, Zone right) {
  const auto is_lot = [](Zone zone) { return zone == Zone::lot || zone == Zone::other; };
  return (is_lot(left) && right != Zone::sidewalk) || (is_lot(right) && left != Zone::sidewalk);
}

// The step between two neighbouring zones along the edge a-b: a kerb, or nothing.
void add_step(Mesh& mesh, const GroundShape& ground, const Eigen::Vector2d& a,
              const Eigen::Vector2d& b, Zone left, Zone right) {
  if (left == right) return;
  mesh.add_quad(ground.on_ground(a, left).cast<float>(), ground.on_ground(b, left).cast<float>(),
                ground.on_ground(b, right).cast<float>(), ground.on_ground(a, right).cast<float>(),
                is_country_edge(left, right) ? Surface::grass : Surface::kerb);
}

}  // namespace

void add_ground(Mesh& mesh, const GroundShape& ground) {
  const CityPlan& plan = ground.plan();
  const std::vector<double> us = axis_lines(plan.streets_along_v, plan.margin_m);
  const std::vector<double> vs = axis_lines(plan.streets_along_u, plan.margin_m);
  const auto zone_of = [&](std::size_t i, std::size_t j) {
    return ground.zone({0.5 * (us[i] + us[i + 1]), 0.5 * (vs[j] + vs[j + 1])});
  };
  for (std::size_t i = 0; i + 1 < us.size(); ++i) {
    for (std::size_t j = 0; j + 1 < vs.size(); ++j) {
      const Zone zone = zone_of(i, j);
      const auto corner = [&](std::size_t di, std::size_t dj) -> Eigen::Vector3f {
        return ground.on_ground({us[i + di], vs[j + dj]}, zone).cast<float>();
      };
      mesh.add_quad(corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1), surface_of(zone, plan));
      const Eigen::Vector2d far(us[i + 1], vs[j + 1]);
      if (i + 2 < us.size()) {
        add_step(mesh, ground, {far.x(), vs[j]}, far, zone, zone_of(i + 1, j));
      }
      if (j + 2 < vs.size()) {
        add_step(mesh, ground, {us[i], far.y()}, far, zone, zone_of(i, j + 1));
      }
    }
  }
}

}  // namespace stillmap::simulation
