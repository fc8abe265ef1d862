#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/simulation/city.hpp"
#include "core/simulation/street_furniture.hpp"
#include "core/simulation/vegetation.hpp"

namespace stillmap {
namespace {

using Eigen::Vector2d;

constexpr std::size_t tree_shapes = 6;
constexpr std::size_t car_shapes = 14;
constexpr double quarter_turn = 0.5 * std::numbers::pi;

// One side of a street, seen in the direction in which its traffic goes.
struct StreetSide {
  const StreetProfile& profile;
  Vector2d start, along;
  double length_m;

  [[nodiscard]] Vector2d at(double along_m, double right_m) const {
    return start + along_m * along + right_m * Vector2d(along.y(), -along.x());
  }
  [[nodiscard]] double heading() const { return std::atan2(along.y(), along.x()); }
};

/// Lines one side of a street after the other.
class StreetFurnisher {
 public:
  StreetFurnisher(City& city, const GroundShape& ground, Random random)
      : city_(city), ground_(ground), random_(random), first_tree_(city.shapes.size()) {
    for (std::size_t i = 0; i < tree_shapes; ++i) city.shapes.push_back(make_tree(fork()));
    for (std::size_t i = 0; i < car_shapes; ++i) add_shape(ObjectKind::car);
    add_shape(ObjectKind::motorcycle);
    add_shape(ObjectKind::bicycle);
  }

  void furnish(const StreetSide& side) {
    park(side);
    light_and_sign(side);
    if (side.profile.verge_m > 1.0) plant_trees(side);
  }

  void equip_crossing(const StreetSide& side) {
    const double kerb = side.profile.half_road_m() + 0.45;
    const double facing = side.heading() + std::numbers::pi - quarter_turn;
    place(make_traffic_light(), side.at(-3.4, kerb), facing);
    place(make_sign(fork()), side.at(-2.2, kerb), facing);
    for (const double at : {-4.6, 3.0, 4.6}) place(make_bollard(), side.at(at, kerb), facing);
  }

 private:
  void park(const StreetSide& side) {
    const double middle = side.profile.half_driven_m() + 0.5 * side.profile.parking_m;
    const double chance = 0.065 * ground_.plan().traffic.parked_per_100m;
    for (double at = 2.0; at < side.length_m; at += random_.uniform(6.0, 6.8)) {
      const Vector2d front = side.at(at + 2.9, middle);
      const Vector2d rear = side.at(at - 2.9, middle);
      const bool bay = ground_.zone(front) == Zone::parking && ground_.zone(rear) == Zone::parking;
      if (!bay || is_crossing(side.at(at, 0.0)) || !random_.chance(chance)) continue;
      const double askew = random_.uniform(-0.03, 0.03);
      const double turned = random_.chance(0.15) ? std::numbers::pi : 0.0;
      const Vector2d spot = side.at(at, middle + random_.uniform(-0.1, 0.12));
      if (random_.chance(0.06)) {
        leave(ObjectKind::motorcycle, car_shapes, spot, side.heading() + 1.1, 1.3);
      } else {
        leave(ObjectKind::car, random_.index(car_shapes), spot, side.heading() + askew + turned,
              2.6);
      }
      if (random_.chance(0.08)) {
        const Vector2d stand = side.at(at, side.profile.half_road_m() + 0.35);
        leave(ObjectKind::bicycle, car_shapes + 1, stand, side.heading() + askew, 1.0);
      }
    }
  }

  void light_and_sign(const StreetSide& side) {
    const double kerb = side.profile.half_road_m() + 0.4;
    for (double at = random_.uniform(4.0, 16.0); at < side.length_m;
         at += random_.uniform(24.0, 30.0)) {
      if (!is_pavement(side.at(at, kerb))) continue;
      place(make_street_light(), side.at(at, kerb), side.heading() + quarter_turn);
    }
    for (double at = random_.uniform(8.0, 25.0); at < side.length_m;
         at += random_.uniform(18.0, 40.0)) {
      if (!is_pavement(side.at(at, kerb))) continue;
      place(make_sign(fork()), side.at(at, kerb),
            side.heading() + quarter_turn + random_.uniform(-0.1, 0.1));
    }
  }

  void plant_trees(const StreetSide& side) {
    const double middle = side.profile.half_road_m() + 0.6 * side.profile.verge_m;
    const double spacing = 100.0 / ground_.plan().blocks.trees_per_100m;
    for (double at = 3.0; at < side.length_m; at += spacing * random_.uniform(0.8, 1.2)) {
      const Vector2d spot = side.at(at, middle);
      if (ground_.zone(spot) != Zone::verge) continue;
      city_.bodies.push_back({.shape = first_tree_ + random_.index(tree_shapes),
                              .T_map_body = ground_.frame_at(spot, random_.uniform(0.0, 6.28))});
    }
  }

  void leave(ObjectKind kind, std::size_t variant, const Vector2d& spot, double heading,
             double wheelbase_m) {
    city_.bodies.push_back({.shape = first_tree_ + tree_shapes + variant,
                            .T_map_body = ground_.leaning_frame_at(spot, heading, wheelbase_m),
                            .label = standing_label(kind),
                            .instance = city_.next_instance(),
                            .brightness = static_cast<float>(random_.uniform(0.25, 1.5))});
  }

  void place(const Mesh& mesh, const Vector2d& spot, double heading) {
    city_.fixed.append(mesh, ground_.frame_at(spot, heading).cast<float>());
  }

  [[nodiscard]] bool is_pavement(const Vector2d& spot) const {
    const Zone zone = ground_.zone(spot);
    return zone == Zone::sidewalk || zone == Zone::verge;
  }

  // Nobody parks where people cross.
  [[nodiscard]] bool is_crossing(const Vector2d& middle) const {
    return std::ranges::any_of(ground_.plan().crossings, [&](const Vector2d& crossing) {
      return (crossing - middle).norm() < 8.0;
    });
  }

  void add_shape(ObjectKind kind) { city_.shapes.push_back(make_object(kind, fork()).mesh); }
  Random fork() { return Random(random_.index(1U << 30U)); }

  City& city_;
  const GroundShape& ground_;
  Random random_;
  std::size_t first_tree_;
};

// From margin to margin, there on one side and back on the other.
std::array<StreetSide, 2> sides_of(const StreetPlan& street, const std::vector<StreetPlan>& across,
                                   double margin, bool along_u) {
  const double low = across.front().position_m - margin;
  const double high = across.back().position_m + margin;
  const auto point = [&](double along) {
    return along_u ? Vector2d(along, street.position_m) : Vector2d(street.position_m, along);
  };
  const Vector2d way = along_u ? Vector2d(1, 0) : Vector2d(0, 1);
  return {{{street.profile, point(low), way, high - low},
           {street.profile, point(high), -way, high - low}}};
}

Vector2d direction_at(const CityPlan& plan, const Vector2d& crossing) {
  for (const StreetPlan& street : plan.streets_along_u) {
    if (std::abs(street.position_m - crossing.y()) < 0.1) return {1, 0};
  }
  return {0, 1};
}

}  // namespace

void furnish_streets(City& city, const GroundShape& ground, Random random) {
  const CityPlan& plan = ground.plan();
  StreetFurnisher furnisher(city, ground, random);
  const auto furnish = [&](const auto& streets, const auto& across, bool along_u) {
    for (const StreetPlan& street : streets) {
      for (const StreetSide& side : sides_of(street, across, plan.margin_m, along_u)) {
        furnisher.furnish(side);
      }
    }
  };
  furnish(plan.streets_along_u, plan.streets_along_v, true);
  furnish(plan.streets_along_v, plan.streets_along_u, false);
  for (const Vector2d& crossing : plan.crossings) {
    const Vector2d along = direction_at(plan, crossing);
    for (const Vector2d& way : {along, Vector2d(-along)}) {
      furnisher.equip_crossing({plan.route_profile, crossing, way, 0.0});
    }
  }
}

}  // namespace stillmap
