#include <array>

#include "core/simulation/object_shapes.hpp"

namespace stillmap::simulation {
namespace {

// Two wheels at `x`, their outer sides `half_width` from the middle.
void add_axle(Mesh& mesh, float x, float half_width, float radius) {
  for (const float side : {-1.0F, 1.0F}) {
    const float y = side * half_width;
    add_tube(mesh, {{x, y - side * 0.22F, radius}, {x, y, radius}, radius, radius, 12},
             Surface::tyre);
  }
}

// At the front and the rear end.
void add_licence_plates(Mesh& mesh, float front, float rear) {
  for (const float x : {front, rear}) {
    add_box(mesh, {x - 0.01F, -0.26F, 0.45F}, {x + 0.01F, 0.26F, 0.56F}, Surface::licence_plate);
  }
}

// Measures of a passenger car; the cabin's x positions run from the rear.
struct CarBody {
  float length, half_width, height, belt, bonnet, bonnet_length;
  float cabin_rear, roof_rear, roof_front;
};

constexpr std::array<CarBody, 8> car_bodies{{
    {4.6F, 0.90F, 1.44F, 0.92F, 0.78F, 1.35F, 0.75F, 1.35F, 2.0F},   // saloon
    {4.0F, 0.86F, 1.48F, 0.92F, 0.82F, 0.95F, 0.05F, 0.35F, 1.6F},   // hatchback
    {4.7F, 0.95F, 1.75F, 1.08F, 1.00F, 1.20F, 0.05F, 0.35F, 1.9F},   // off-roader
    {4.6F, 0.88F, 1.46F, 0.92F, 0.80F, 1.25F, 0.05F, 0.45F, 1.9F},   // estate
    {3.5F, 0.82F, 1.50F, 0.94F, 0.86F, 0.70F, 0.05F, 0.25F, 1.25F},  // small car
    {4.3F, 0.90F, 1.62F, 1.00F, 0.92F, 0.80F, 0.05F, 0.25F, 1.7F},   // family van
    {4.9F, 0.96F, 1.95F, 1.10F, 1.02F, 0.75F, 0.03F, 0.12F, 1.4F},   // minibus
    {5.4F, 1.00F, 2.40F, 1.25F, 1.05F, 0.75F, 0.02F, 0.08F, 1.2F},   // delivery van
}};

// Random measures; the bonnet stays below the cabin and the roof within it.
CarBody varied(CarBody car, Random& random) {
  const auto factor = [&] { return random.between(0.94, 1.06); };
  car.length *= factor();
  car.half_width *= factor();
  car.height *= factor();
  car.bonnet_length *= factor();
  car.roof_rear *= factor();
  car.roof_front *= factor();
  return car;
}

Mesh make_car(const CarBody& car) {
  Mesh mesh;
  const float rear = -0.5F * car.length;
  const float front = 0.5F * car.length;
  const std::array<Eigen::Vector2f, 7> side{{
      {rear + 0.05F, 0.22F},
      {front - 0.1F, 0.22F},
      {front, 0.45F},
      {front - 0.08F, car.bonnet - 0.06F},
      {front - car.bonnet_length, car.belt},
      {rear + 0.05F, car.belt},
      {rear, 0.5F},
  }};
  add_prism(mesh, side, car.half_width, Surface::paint);
  const FrustumFace sill{rear + car.cabin_rear, front - car.bonnet_length + 0.1F,
                         car.half_width - 0.03F, car.belt};
  const FrustumFace roof{rear + car.roof_rear, front - car.roof_front, car.half_width - 0.2F,
                         car.height};
  add_frustum(mesh, sill, roof, car.height > 2.0F ? Surface::paint : Surface::glass,
              Surface::paint);
  const float radius = car.height > 1.6F ? 0.36F : 0.31F;
  add_axle(mesh, front - 0.85F, car.half_width + 0.01F, radius);
  add_axle(mesh, rear + 0.8F, car.half_width + 0.01F, radius);
  add_licence_plates(mesh, front, rear);
  for (const float y : {-1.0F, 1.0F}) {
    const float mirror = y * (car.half_width + 0.1F);
    add_box(mesh, {front - car.bonnet_length - 0.35F, mirror - 0.08F, car.belt},
            {front - car.bonnet_length - 0.22F, mirror + 0.08F, car.belt + 0.15F}, Surface::paint);
  }
  return mesh;
}

Mesh make_car(Random& random) {
  // Vans are rarer than cars.
  constexpr std::size_t vans = 2;
  const bool van = random.chance(0.2);
  const std::size_t body =
      van ? car_bodies.size() - 1 - random.index(vans) : random.index(car_bodies.size() - vans);
  return make_car(varied(car_bodies[body], random));
}

Mesh make_lorry(Random& random) {
  Mesh mesh;
  const float front = random.between(3.6, 4.6);
  const bool tank = random.chance(0.2);
  const float cab_rear = front - 2.0F;
  add_frustum(mesh, {cab_rear, front, 1.2F, 0.5F}, {cab_rear, front, 1.2F, 1.6F}, Surface::paint,
              Surface::paint);
  add_frustum(mesh, {cab_rear, front, 1.2F, 1.6F}, {cab_rear, front - 0.2F, 1.15F, 2.9F},
              Surface::glass, Surface::paint);
  add_box(mesh, {-front, -0.5F, 0.6F}, {cab_rear, 0.5F, 0.95F}, Surface::tyre);
  if (tank) {
    add_tube(mesh, {{-front, 0, 2.05F}, {cab_rear - 0.3F, 0, 2.05F}, 1.1F, 1.1F, 16},
             Surface::paint);
  } else {
    add_box(mesh, {-front, -1.22F, 1.0F}, {cab_rear - 0.25F, 1.22F, 3.4F}, Surface::paint);
  }
  for (const float x : {front - 1.2F, -front + 1.2F, -front + 2.4F}) add_axle(mesh, x, 1.22F, 0.5F);
  add_licence_plates(mesh, front, -front);
  return mesh;
}

// Box van, tipper or pick-up: a van's cab and a separate body.
Mesh make_small_truck(Random& random) {
  Mesh mesh;
  const float front = random.between(2.5, 3.2);
  const float cab_rear = front - 1.9F;
  const float half = random.between(0.92, 1.05);
  add_frustum(mesh, {cab_rear, front, half, 0.35F}, {cab_rear, front - 0.25F, half, 1.1F},
              Surface::paint, Surface::paint);
  add_frustum(mesh, {cab_rear, front - 0.8F, half - 0.03F, 1.1F},
              {cab_rear + 0.1F, front - 1.3F, half - 0.15F, 1.95F}, Surface::glass, Surface::paint);
  add_box(mesh, {-front, -0.4F, 0.45F}, {cab_rear, 0.4F, 0.7F}, Surface::tyre);
  const double kind = random.uniform();
  const float body_front = cab_rear - 0.1F;
  if (kind < 0.5) {
    const float top = random.between(2.5, 3.1);
    add_box(mesh, {-front, -half - 0.1F, 0.8F}, {body_front, half + 0.1F, top}, Surface::paint);
  } else {
    const float rim = random.between(1.05, 1.4);
    add_box(mesh, {-front, -half, 0.75F}, {body_front, half, 0.85F}, Surface::paint);
    for (const float y : {-half, half}) {
      add_box(mesh, {-front, y - 0.03F, 0.85F}, {body_front, y + 0.03F, rim}, Surface::paint);
    }
    add_box(mesh, {-front, -half, 0.85F}, {-front + 0.05F, half, rim}, Surface::paint);
  }
  add_axle(mesh, front - 0.8F, half + 0.01F, 0.36F);
  add_axle(mesh, -front + 1.0F, half + 0.01F, 0.36F);
  add_licence_plates(mesh, front, -front);
  return mesh;
}

struct BusBody {
  float front = 5.2F, sill = 1.25F, roof = 2.5F;
  /// Trams hide their wheels behind skirts.
  bool tram = false;
};

// Bus, minibus or a section of a tram.
BusBody random_bus(Random& random) {
  return {.front = random.between(4.0, 5.2),
          .sill = random.between(1.0, 1.35),
          .roof = random.between(2.3, 2.6),
          .tram = random.chance(0.25)};
}

Mesh make_bus(const BusBody& bus) {
  Mesh mesh;
  const float front = bus.front;
  const float half = 1.27F;
  const float floor = bus.tram ? 0.08F : 0.35F;
  add_box(mesh, {-front, -half, floor}, {front, half, bus.sill}, Surface::paint);
  add_box(mesh, {-front + 0.1F, -half + 0.04F, bus.sill}, {front - 0.06F, half - 0.04F, bus.roof},
          Surface::glass);
  for (float x = -front; x < front - 0.2F; x += 1.45F) {
    add_box(mesh, {x, -half, bus.sill}, {x + 0.16F, half, bus.roof}, Surface::paint);
  }
  add_box(mesh, {-front, -half, bus.roof}, {front, half, 3.05F}, Surface::paint);
  add_box(mesh, {-2.5F, -0.8F, 3.05F}, {0.5F, 0.8F, 3.25F}, Surface::paint);
  if (bus.tram) return mesh;
  add_axle(mesh, front - 2.6F, half + 0.01F, 0.48F);
  add_axle(mesh, -front + 3.0F, half + 0.01F, 0.48F);
  add_licence_plates(mesh, front, -front);
  return mesh;
}

Mesh make_caravan(Random& random) {
  Mesh mesh;
  const float half = random.between(1.9, 2.9);
  const float top = random.between(2.3, 2.7);
  const float slant = random.between(0.1, 0.5);
  const std::array<Eigen::Vector2f, 6> side{{{-half, 0.45F},
                                             {half, 0.45F},
                                             {half, 1.2F},
                                             {half - slant, top},
                                             {-half + 0.15F, top},
                                             {-half, 1.2F}}};
  const float half_width = random.between(1.0, 1.2);
  add_prism(mesh, side, half_width, Surface::paint);
  for (const float y : {-1.0F, 1.0F}) {
    add_box(mesh, {-0.9F, y * half_width - 0.01F, 1.3F}, {0.7F, y * half_width + 0.01F, 1.9F},
            Surface::glass);
  }
  add_tube(mesh, {{half, 0, 0.5F}, {half + 1.1F, 0, 0.45F}, 0.05F, 0.05F, 6}, Surface::tyre);
  add_tube(mesh, {{half + 0.9F, 0, 0}, {half + 0.9F, 0, 0.6F}, 0.03F, 0.03F, 6}, Surface::tyre);
  add_axle(mesh, -0.1F, half_width, 0.32F);
  add_licence_plates(mesh, -half, -half);
  return mesh;
}

Mesh make_trailer(Random& random) {
  Mesh mesh;
  const float half = random.between(0.9, 2.2);
  const float half_width = random.between(0.65, 1.0);
  const float rim = random.between(0.75, 1.1);
  add_box(mesh, {-half, -half_width, 0.45F}, {half, half_width, 0.55F}, Surface::paint);
  for (const float y : {-half_width, half_width}) {
    add_box(mesh, {-half, y - 0.02F, 0.55F}, {half, y + 0.02F, rim}, Surface::paint);
  }
  if (random.chance(0.5)) {
    add_frustum(mesh, {-half, half, half_width, rim}, {-half, half, half_width - 0.05F, rim + 0.9F},
                Surface::cloth, Surface::cloth);
  }
  add_tube(mesh, {{half, 0, 0.5F}, {half + 1.2F, 0, 0.45F}, 0.04F, 0.04F, 6}, Surface::tyre);
  add_tube(mesh, {{half + 1.0F, 0, 0}, {half + 1.0F, 0, 0.6F}, 0.03F, 0.03F, 6}, Surface::tyre);
  add_axle(mesh, 0, half_width + 0.2F, 0.28F);
  return mesh;
}

Mesh make_tractor(Random& random) {
  Mesh mesh;
  const float big = random.between(0.65, 0.9);
  add_box(mesh, {0.1F, -0.4F, 0.7F}, {1.9F, 0.4F, 1.45F}, Surface::paint);
  add_frustum(mesh, {-1.2F, 0.2F, 0.75F, 1.2F}, {-1.0F, 0.1F, 0.65F, 2.6F}, Surface::glass,
              Surface::paint);
  add_box(mesh, {-1.2F, -0.75F, 0.9F}, {0.2F, 0.75F, 1.25F}, Surface::paint);
  for (const float y : {-0.7F, 0.7F}) {
    add_tube(mesh, {{-1.05F, y, 1.2F}, {-0.95F, y, 2.6F}, 0.06F, 0.06F, 6}, Surface::paint);
    add_tube(mesh, {{0.15F, y, 1.2F}, {0.1F, y, 2.6F}, 0.06F, 0.06F, 6}, Surface::paint);
  }
  add_tube(mesh, {{1.2F, 0.3F, 1.4F}, {1.2F, 0.3F, 2.3F}, 0.05F, 0.05F, 6}, Surface::tyre);
  add_axle(mesh, -0.8F, 1.05F, big);
  add_axle(mesh, 1.4F, 0.95F, 0.45F);
  return mesh;
}

Mesh make_digger(Random& random) {
  Mesh mesh;
  for (const float y : {-0.95F, 0.95F}) {
    add_box(mesh, {-1.6F, y - 0.25F, 0.02F}, {1.6F, y + 0.25F, 0.75F}, Surface::tyre);
  }
  add_box(mesh, {-1.7F, -1.2F, 0.85F}, {1.0F, 1.2F, 1.7F}, Surface::paint);
  add_frustum(mesh, {-0.3F, 1.1F, 0.5F, 1.7F}, {-0.3F, 0.9F, 0.45F, 2.8F}, Surface::glass,
              Surface::paint);
  const Eigen::Vector3f elbow(random.between(2.0, 3.0), 0, random.between(2.8, 3.8));
  const Eigen::Vector3f hand(random.between(3.4, 4.6), 0, random.between(0.6, 1.6));
  add_tube(mesh, {{0.9F, 0, 1.4F}, elbow, 0.25F, 0.2F, 6}, Surface::paint);
  add_tube(mesh, {elbow, hand, 0.2F, 0.13F, 6}, Surface::paint);
  add_box(mesh, hand - Eigen::Vector3f(0.5F, 0.6F, 0.5F), hand + Eigen::Vector3f(0.3F, 0.6F, 0.2F),
          Surface::paint);
  return mesh;
}

// Caravan, trailer, tractor or digger.
Mesh make_other_vehicle(Random& random) {
  const double kind = random.uniform();
  if (kind < 0.35) return make_caravan(random);
  if (kind < 0.65) return make_trailer(random);
  return kind < 0.85 ? make_tractor(random) : make_digger(random);
}

}  // namespace

Mesh make_vehicle(ObjectKind kind, Variety variety, Random& random) {
  const bool any = variety == Variety::any;
  switch (kind) {
    case ObjectKind::car:
      return make_car(random);
    case ObjectKind::truck:
      return any && !random.chance(0.5) ? make_small_truck(random) : make_lorry(random);
    case ObjectKind::bus:
      return make_bus(any ? random_bus(random) : BusBody{});
    default:
      return make_other_vehicle(random);
  }
}

}  // namespace stillmap::simulation
