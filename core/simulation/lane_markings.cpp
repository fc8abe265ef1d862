#include <cmath>

#include "core/simulation/ground_mesh.hpp"

namespace stillmap::simulation {
namespace {

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
  for (double at = clear; at + 3.0 < leg.length_m - clear; at += 8.0) {
    const bool has_median = profile.half_median_m > 0.0;
    for (int line = has_median ? 1 : 0; line < profile.lanes; ++line) {
      const double offset = profile.half_median_m + line * profile.lane_width_m;
      add_stripe(mesh, ground, leg, {at, at + 3.0, offset, 0.14});
      if (line > 0) add_stripe(mesh, ground, leg, {at, at + 3.0, -offset, 0.14});
    }
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
