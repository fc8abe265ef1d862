#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/simulation/city.hpp"
#include "core/simulation/city_shapes.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

constexpr double quarter_turn = 0.5 * std::numbers::pi;

/// Furnishes the sides of the streets and the crossings.
class StreetFurnisher {
 public:
  StreetFurnisher(City& city, const GroundShape& ground, Random random)
      : city_(city), ground_(ground), many_(ground.plan().many_shapes), random_(random) {
    trees_ = city.add_shapes(
        6, [&] { return many_ ? make_any_tree(random_.fork()) : make_tree(random_.fork()); });
    if (!many_) return;
    bushes_ = city.add_shapes(4, [&] { return make_any_bush(random_.fork()); });
    people_ =
        city.add_shapes(6, [&] { return make_object(ObjectKind::person, random_.fork()).mesh; });
  }

  void furnish(const StreetSide& side) {
    light_and_sign(side);
    if (side.profile.verge_m > 1.0) plant_trees(side);
    if (many_) add_objects(side);
    if (many_ && random_.chance(0.4)) plant_bushes(side);
    if (ground_.plan().traffic.groups_per_100m > 0.0) add_groups(side);
  }

  void equip_crossing(const StreetSide& side) {
    const double kerb = side.profile.half_road_m() + 0.45;
    const double facing = side.heading() + std::numbers::pi - quarter_turn;
    place(make_traffic_light(), side.at(-3.4, kerb), facing);
    place(many_ ? make_any_sign(random_.fork()) : make_sign(random_.fork()), side.at(-2.2, kerb),
          facing);
    for (const double at : {-4.6, 3.0, 4.6}) place(make_bollard(), side.at(at, kerb), facing);
  }

 private:
  void light_and_sign(const StreetSide& side) {
    const double kerb = side.profile.half_road_m() + 0.4;
    for (double at = random_.uniform(4.0, 16.0); at < side.length_m;
         at += random_.uniform(24.0, many_ ? 60.0 : 30.0)) {
      if (!is_pavement(side.at(at, kerb))) continue;
      place(many_ ? make_any_street_light(random_.fork()) : make_street_light(), side.at(at, kerb),
            side.heading() + quarter_turn);
    }
    const double spread = many_ ? 0.8 : 0.1;
    for (double at = random_.uniform(8.0, 25.0); at < side.length_m;
         at += many_ ? random_.uniform(10.0, 60.0) : random_.uniform(18.0, 40.0)) {
      if (!is_pavement(side.at(at, kerb))) continue;
      place(many_ ? make_any_sign(random_.fork()) : make_sign(random_.fork()), side.at(at, kerb),
            side.heading() + quarter_turn + random_.uniform(-spread, spread));
    }
  }

  // Poles in rows, bins, benches, shelters.
  void add_objects(const StreetSide& side) {
    const double kerb = side.profile.half_road_m() + 0.35;
    const double back = side.profile.half_street_m() - 0.5;
    for (double at = random_.uniform(2.0, 20.0); at < side.length_m;
         at += random_.uniform(8.0, 50.0)) {
      const double heading = side.heading() + quarter_turn;
      const double kind = random_.uniform();
      if (kind < 0.3) {
        add_pole_row(side, at, random_.chance(0.7) ? kerb : back);
      } else if (kind < 0.9) {
        place_on_pavement(make_street_object(random_.fork()), side.at(at, back), heading);
      } else if (side.profile.sidewalk_m > 2.5) {
        place_on_pavement(make_shelter(random_.fork()), side.at(at, back - 0.6), heading);
      }
    }
  }

  void add_pole_row(const StreetSide& side, double at, double right_m) {
    const Mesh pole = make_any_pole(random_.fork());
    const std::size_t count = 1 + random_.index(4);
    const double step = random_.uniform(1.2, 2.5);
    for (std::size_t i = 0; i < count; ++i) {
      place_on_pavement(pole, side.at(at + static_cast<double>(i) * step, right_m), 0.0);
    }
  }

  // Groups of people who face each other.
  void add_groups(const StreetSide& side) {
    const double spacing = 100.0 / ground_.plan().traffic.groups_per_100m;
    for (double at = spacing * random_.uniform(); at < side.length_m;
         at += spacing * random_.uniform(0.5, 1.5)) {
      const double low = side.profile.half_road_m() + 0.5;
      const double right = random_.uniform(low, std::max(low, side.profile.half_street_m() - 0.5));
      const std::size_t people = 1 + random_.index(5);
      for (std::size_t i = 0; i < people; ++i) {
        const double angle =
            2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(people);
        const Vector2d spot =
            side.at(at, right) + 0.55 * Vector2d(std::cos(angle), std::sin(angle));
        if (is_pavement(spot)) add_person(spot, angle + std::numbers::pi);
      }
    }
  }

  void add_person(const Vector2d& spot, double heading) {
    city_.bodies.push_back({.shape = people_.draw(random_),
                            .T_map_body = ground_.frame_at(spot, heading),
                            .label = standing_label(ObjectKind::person),
                            .instance = city_.next_instance(),
                            .brightness = random_.between(0.25, 1.5)});
  }

  void plant_trees(const StreetSide& side) {
    const double middle = side.profile.half_road_m() + 0.6 * side.profile.verge_m;
    const double spacing = 100.0 / ground_.plan().blocks.trees_per_100m;
    for (double at = 3.0; at < side.length_m; at += spacing * random_.uniform(0.8, 1.2)) {
      const Vector2d spot = side.at(at, middle);
      if (ground_.zone(spot) != Zone::verge) continue;
      city_.bodies.push_back({.shape = trees_.draw(random_),
                              .T_map_body = ground_.frame_at(spot, random_.uniform(0.0, 6.28))});
    }
  }

  // On the verge, or at the back of the sidewalk.
  void plant_bushes(const StreetSide& side) {
    const StreetProfile& profile = side.profile;
    const bool verge = profile.verge_m > 1.0;
    const double right =
        verge ? profile.half_road_m() + 0.6 * profile.verge_m : profile.half_street_m() + 0.3;
    for (double at = random_.uniform(0.0, 10.0); at < side.length_m;
         at += random_.chance(0.1) ? random_.uniform(5.0, 30.0) : random_.uniform(0.6, 2.0)) {
      const Vector2d spot = side.at(at, right + random_.uniform(-0.3, 0.3));
      if (ground_.zone(spot) != (verge ? Zone::verge : Zone::lot)) continue;
      city_.bodies.push_back({.shape = bushes_.draw(random_),
                              .T_map_body = ground_.frame_at(spot, random_.uniform(0.0, 6.28))});
    }
  }

  void place_on_pavement(const Mesh& mesh, const Vector2d& spot, double heading) {
    if (is_pavement(spot)) place(mesh, spot, heading);
  }

  void place(const Mesh& mesh, const Vector2d& spot, double heading) {
    city_.fixed.append(mesh, ground_.frame_at(spot, heading).cast<float>());
  }

  // Off the road; in cities of many shapes, the lot counts too where there is no sidewalk.
  [[nodiscard]] bool is_pavement(const Vector2d& spot) const {
    const Zone zone = ground_.zone(spot);
    return zone == Zone::sidewalk || zone == Zone::verge || (many_ && zone == Zone::lot);
  }

  City& city_;
  const GroundShape& ground_;
  bool many_;
  Random random_;
  ShapeRange trees_, bushes_, people_;
};

}  // namespace

void furnish_streets(City& city, const GroundShape& ground, Random random) {
  const CityPlan& plan = ground.plan();
  StreetFurnisher furnisher(city, ground, random);
  for (const StreetSide& side : street_sides(plan)) furnisher.furnish(side);
  for (const Vector2d& crossing : plan.crossings) {
    const Vector2d along = plan.direction_at(crossing);
    for (const Vector2d& way : {along, Vector2d(-along)}) {
      furnisher.equip_crossing({plan.route_profile, crossing, way, 0.0});
    }
  }
}

}  // namespace stillmap::simulation
