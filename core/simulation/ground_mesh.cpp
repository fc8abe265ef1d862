#include <algorithm>
#include <cmath>

#include "core/simulation/ground.hpp"

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
    case Zone::kerbside:
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

// Roads without a sidewalk end in grass instead of a kerb.
bool is_country_edge(Zone left, Zone right) {
  const auto is_lot = [](Zone zone) { return zone == Zone::lot || zone == Zone::other; };
  return (is_lot(left) && right != Zone::sidewalk) || (is_lot(right) && left != Zone::sidewalk);
}

bool is_carriageway(Zone zone) { return zone == Zone::road || zone == Zone::kerbside; }

// The step between two neighbouring zones along the edge a-b: a kerb, or nothing.
void add_step(Mesh& mesh, const GroundShape& ground, const Eigen::Vector2d& a,
              const Eigen::Vector2d& b, Zone left, Zone right) {
  if (left == right || (is_carriageway(left) && is_carriageway(right))) return;
  mesh.add_quad(ground.on_ground(a, left).cast<float>(), ground.on_ground(b, left).cast<float>(),
                ground.on_ground(b, right).cast<float>(), ground.on_ground(a, right).cast<float>(),
                is_country_edge(left, right) ? Surface::grass : Surface::kerb);
}

// One leg of the route: where it starts, and its directions along and to the left.
struct Leg {
  Eigen::Vector2d start, along, left;
  double length_m;
};

struct Stripe {
  double from_m, to_m, offset_m, width_m;
};

// Short pieces, so that the paint follows the hills.
void add_stripe(Mesh& mesh, const GroundShape& ground, const Leg& leg, const Stripe& stripe) {
  const auto at = [&](double along, double side) -> Eigen::Vector3f {
    const Eigen::Vector2d spot = leg.start + along * leg.along + side * leg.left;
    return (ground.on_ground(spot, Zone::road) + Eigen::Vector3d(0, 0, 0.006)).cast<float>();
  };
  const int pieces = std::max(1, static_cast<int>(std::ceil((stripe.to_m - stripe.from_m) / 1.0)));
  const double low = stripe.offset_m - 0.5 * stripe.width_m;
  const double high = stripe.offset_m + 0.5 * stripe.width_m;
  for (int i = 0; i < pieces; ++i) {
    const double from = stripe.from_m + (stripe.to_m - stripe.from_m) * i / pieces;
    const double to = stripe.from_m + (stripe.to_m - stripe.from_m) * (i + 1) / pieces;
    mesh.add_quad(at(from, low), at(to, low), at(to, high), at(from, high), Surface::lane_marking);
  }
}

void add_leg_lines(Mesh& mesh, const GroundShape& ground, const Leg& leg) {
  const StreetProfile& profile = ground.plan().route_profile;
  const double clear = profile.half_road_m() + 3.0;
  const CityPlan& plan = ground.plan();
  for (double at = clear; at + 3.0 < leg.length_m - clear; at += 8.0) {
    const bool has_median = profile.half_median_m > 0.0;
    for (int line = has_median ? 1 : 0; plan.lane_lines && line < profile.lanes; ++line) {
      const double offset = profile.half_median_m + line * profile.lane_width_m;
      add_stripe(mesh, ground, leg, {at, at + 3.0, offset, 0.14});
      if (line > 0) add_stripe(mesh, ground, leg, {at, at + 3.0, -offset, 0.14});
    }
    if (!plan.edge_lines) continue;
    const double edge = profile.half_median_m + profile.lanes * profile.lane_width_m;
    for (const double side : {-1.0, 1.0}) {
      add_stripe(mesh, ground, leg, {at, at + 8.0, side * edge, 0.12});
    }
  }
}

void add_crossing(Mesh& mesh, const GroundShape& ground, const Leg& leg, double at_m) {
  const StreetProfile& profile = ground.plan().route_profile;
  const double half = profile.half_driven_m();
  for (double side = profile.half_median_m + 0.5; side < half; side += 1.0) {
    add_stripe(mesh, ground, leg, {at_m - 1.8, at_m + 1.8, side, 0.5});
    add_stripe(mesh, ground, leg, {at_m - 1.8, at_m + 1.8, -side, 0.5});
  }
  const double lanes = half - profile.half_median_m;
  const double middle = profile.half_median_m + 0.5 * lanes;
  add_stripe(mesh, ground, leg, {at_m - 3.6, at_m - 3.2, -middle, lanes});
  add_stripe(mesh, ground, leg, {at_m + 3.2, at_m + 3.6, middle, lanes});
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
      const Eigen::Vector2d far(us[i + 1], vs[j + 1]);
      const bool is_paved = zone == Zone::lot && ground.is_paved_yard({us[i], vs[j]});
      mesh.add_quad(corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1),
                    is_paved ? Surface::pavement : surface_of(zone, plan));
      if (i + 2 < us.size()) {
        add_step(mesh, ground, {far.x(), vs[j]}, far, zone, zone_of(i + 1, j));
      }
      if (j + 2 < vs.size()) {
        add_step(mesh, ground, {us[i], far.y()}, far, zone, zone_of(i, j + 1));
      }
    }
  }
}

void add_lane_markings(Mesh& mesh, const GroundShape& ground) {
  const CityPlan& plan = ground.plan();
  for (std::size_t i = 0; i < plan.route.size(); ++i) {
    const Eigen::Vector2d way = plan.route[(i + 1) % plan.route.size()] - plan.route[i];
    const Eigen::Vector2d along = way.normalized();
    const Leg leg{plan.route[i], along, {-along.y(), along.x()}, way.norm()};
    add_leg_lines(mesh, ground, leg);
    for (const Eigen::Vector2d& crossing : plan.crossings) {
      const Eigen::Vector2d offset = crossing - leg.start;
      const double at = offset.dot(leg.along);
      const bool on_leg = std::abs(offset.dot(leg.left)) < 0.1 && at > 0.0 && at < leg.length_m;
      if (on_leg) add_crossing(mesh, ground, leg, at);
    }
  }
}

}  // namespace stillmap::simulation
