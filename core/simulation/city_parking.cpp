// Parked vehicles: in the bays along the streets and on car parks.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "core/simulation/city.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

constexpr double quarter_turn = 0.5 * std::numbers::pi;

// In bays deeper than this, cars park perpendicular to the street.
constexpr double deep_bay_m = 3.8;

/// Places vehicles of some shapes of each kind.
class VehiclePark {
 public:
  VehiclePark(City& city, const GroundShape& ground, Random random)
      : city_(city), ground_(ground), random_(random) {
    const bool many = ground.plan().many_shapes;
    add_shapes(ObjectKind::car, 14);
    add_shapes(ObjectKind::motorcycle, many ? 4 : 1);
    add_shapes(ObjectKind::bicycle, many ? 4 : 1);
    if (!many) return;
    add_shapes(ObjectKind::truck, 4);
    add_shapes(ObjectKind::bus, 2);
    add_shapes(ObjectKind::other_vehicle, 6);
  }

  void park_along(const StreetSide& side) {
    const std::optional<Bays> bays = bays_of(side.profile);
    if (!bays) return;
    for (double at = 2.0; at < side.length_m;) {
      const ObjectKind kind = random_kind();
      const std::size_t shape = random_shape(kind);
      const double room_m = bays->across ? random_.uniform(2.5, 3.1) : lengthwise_room_m(shape);
      const double middle = at + 0.5 * (room_m - 6.0);
      if (random_.chance(share_taken()) && is_free(side, *bays, middle, 0.5 * room_m - 0.3)) {
        park_at(side, *bays, middle, kind, shape);
      }
      at += room_m;
    }
  }

  void fill_car_park(const GroundPatch& patch) {
    const Eigen::AlignedBox2d& area = patch.area_plan;
    constexpr double row_m = 5.2;
    bool aisle_next = false;
    for (double v = area.min().y() + 0.3; v + row_m < area.max().y();) {
      for (double u = area.min().x() + 1.5; u + 1.5 < area.max().x();
           u += random_.uniform(2.5, 3.0)) {
        if (!random_.chance(share_taken())) continue;
        const double turned = random_.chance(0.5) ? quarter_turn : -quarter_turn;
        add_parked(ObjectKind::car, random_shape(ObjectKind::car), {u, v + 0.5 * row_m},
                   turned + random_.uniform(-0.06, 0.06));
      }
      v += row_m + (aisle_next ? 6.0 : 0.6);
      aisle_next = !aisle_next;
    }
  }

  /// A row of two-wheelers side by side.
  void park_two_wheelers(const StreetSide& side, double at, double right_m) {
    const ObjectKind kind = random_.chance(0.6) ? ObjectKind::bicycle : ObjectKind::motorcycle;
    const std::size_t count = 1 + random_.index(6);
    const double turn = random_.chance(0.5) ? quarter_turn : 0.9;
    for (std::size_t i = 0; i < count; ++i) {
      const double along = at + static_cast<double>(i) * random_.uniform(0.6, 0.9);
      add_parked(kind, random_shape(kind), side.at(along, right_m), side.heading() + turn);
    }
  }

 private:
  // Parking positions beside a street.
  struct Bays {
    double middle_m;
    Zone zone;
    bool across;
  };

  // Where the street has no room for parking, vehicles stand on a sidewalk that is wide enough.
  [[nodiscard]] std::optional<Bays> bays_of(const StreetProfile& profile) const {
    if (profile.parking_m > 1.0) {
      return Bays{profile.half_driven_m() + 0.5 * profile.parking_m,
                  profile.has_bays ? Zone::parking : Zone::kerbside,
                  profile.parking_m > deep_bay_m};
    }
    const bool room = profile.verge_m == 0.0 && profile.sidewalk_m > 2.2;
    if (!ground_.plan().many_shapes || !room) return std::nullopt;
    return Bays{profile.half_road_m() + 0.8, Zone::sidewalk, false};
  }

  void add_shapes(ObjectKind kind, std::size_t count) {
    shapes_[kind] = city_.add_shapes(count, [&] {
      ObjectShape shape = make_object(kind, random_.fork(), Variety::any);
      lengths_m_[city_.shapes.size()] = shape.length_m;
      return std::move(shape.mesh);
    });
  }

  [[nodiscard]] double share_taken() const {
    return std::min(1.0, 0.065 * ground_.plan().traffic.parked_per_100m);
  }

  ObjectKind random_kind() {
    const ParkingPlan& plan = ground_.plan().parking;
    double draw = random_.uniform();
    const auto falls_to = [&](double share) { return (draw -= share) < 0.0; };
    if (falls_to(plan.share_motorcycles)) return ObjectKind::motorcycle;
    if (falls_to(plan.share_trucks)) return ObjectKind::truck;
    if (falls_to(plan.share_buses)) return ObjectKind::bus;
    if (falls_to(plan.share_other_vehicles)) return ObjectKind::other_vehicle;
    return ObjectKind::car;
  }

  std::size_t random_shape(ObjectKind kind) { return shapes_.at(kind).draw(random_); }

  double lengthwise_room_m(std::size_t shape) {
    return std::max(random_.uniform(6.0, 6.8), lengths_m_.at(shape) + random_.uniform(0.5, 1.5));
  }

  // A bay from end to end, and no pedestrian crossing.
  [[nodiscard]] bool is_free(const StreetSide& side, const Bays& bays, double at,
                             double half_m) const {
    const bool is_crossing = std::ranges::any_of(
        ground_.plan().crossings,
        [&](const Vector2d& crossing) { return (crossing - side.at(at, 0.0)).norm() < 8.0; });
    const Zone front = ground_.zone(side.at(at + half_m, bays.middle_m));
    const Zone rear = ground_.zone(side.at(at - half_m, bays.middle_m));
    return !is_crossing && front == bays.zone && rear == bays.zone;
  }

  void park_at(const StreetSide& side, const Bays& bays, double at, ObjectKind kind,
               std::size_t shape) {
    const double askew = random_.uniform(-0.03, 0.03);
    const double turned = random_.chance(0.15) ? std::numbers::pi : 0.0;
    const double aslant = kind == ObjectKind::motorcycle ? 1.1 : 0.0;
    const Vector2d spot = side.at(at, bays.middle_m + random_.uniform(-0.1, 0.12));
    add_parked(kind, shape, spot,
               side.heading() + askew + turned + (bays.across ? quarter_turn : aslant));
    if (random_.chance(ground_.plan().parking.share_bicycles)) {
      add_parked(ObjectKind::bicycle, random_shape(ObjectKind::bicycle),
                 side.at(at, side.profile.half_road_m() + 0.35), side.heading() + askew);
    }
  }

  void add_parked(ObjectKind kind, std::size_t shape, const Vector2d& spot, double heading) {
    const double wheelbase_m = std::max(1.0, 0.55 * lengths_m_.at(shape));
    const double darkest = ground_.plan().many_shapes ? 0.06 : 0.25;
    city_.bodies.push_back({.shape = shape,
                            .T_map_body = ground_.leaning_frame_at(spot, heading, wheelbase_m),
                            .label = standing_label(kind),
                            .instance = city_.next_instance(),
                            .brightness = random_.between(darkest, 1.5)});
  }

  City& city_;
  const GroundShape& ground_;
  Random random_;
  std::map<ObjectKind, ShapeRange> shapes_;
  std::map<std::size_t, double> lengths_m_;
};

}  // namespace

void park_vehicles(City& city, const GroundShape& ground, Random random) {
  const CityPlan& plan = ground.plan();
  VehiclePark park(city, ground, random);
  for (const StreetSide& side : street_sides(plan)) {
    park.park_along(side);
    if (!plan.many_shapes || side.profile.sidewalk_m < 1.5) continue;
    const double right_m = side.profile.half_street_m() - 0.6;
    for (double at = random.uniform(3.0, 30.0); at < side.length_m;
         at += random.uniform(8.0, 50.0)) {
      if (ground.zone(side.at(at, right_m)) == Zone::sidewalk) {
        park.park_two_wheelers(side, at, right_m);
      }
    }
  }
  for (const GroundPatch& patch : plan.patches) {
    if (patch.zone == Zone::parking) park.fill_car_park(patch);
  }
}

}  // namespace stillmap::simulation
