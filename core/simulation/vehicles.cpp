#include "core/simulation/vehicles.hpp"

namespace stillmap {
namespace {

void add_axle(Mesh& mesh, float x, float half_width, float radius) {
  for (const float side : {-1.0F, 1.0F}) {
    const float y = side * half_width;
    add_tube(mesh, {{x, y - side * 0.22F, radius}, {x, y, radius}, radius, radius, 12},
             Surface::tyre);
  }
}

void add_plates(Mesh& mesh, float front, float rear) {
  for (const float x : {front, rear}) {
    add_box(mesh, {x - 0.01F, -0.26F, 0.45F}, {x + 0.01F, 0.26F, 0.56F}, Surface::licence_plate);
  }
}

// Measures of a passenger car; the cabin's x positions run from the rear.
struct CarBody {
  float length, half_width, height, belt, bonnet, bonnet_length;
  float cabin_rear, roof_rear, roof_front;
};

constexpr std::array<CarBody, 4> car_bodies{{
    {4.6F, 0.90F, 1.44F, 0.92F, 0.78F, 1.35F, 0.75F, 1.35F, 2.0F},  // saloon
    {4.0F, 0.86F, 1.48F, 0.92F, 0.82F, 0.95F, 0.05F, 0.35F, 1.6F},  // hatchback
    {4.7F, 0.95F, 1.75F, 1.08F, 1.00F, 1.20F, 0.05F, 0.35F, 1.9F},  // off-roader
    {5.4F, 1.00F, 2.40F, 1.25F, 1.05F, 0.75F, 0.02F, 0.08F, 1.2F},  // delivery van
}};

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
  add_plates(mesh, front, rear);
  for (const float y : {-1.0F, 1.0F}) {
    const float mirror = y * (car.half_width + 0.1F);
    add_box(mesh, {front - car.bonnet_length - 0.35F, mirror - 0.08F, car.belt},
            {front - car.bonnet_length - 0.22F, mirror + 0.08F, car.belt + 0.15F}, Surface::paint);
  }
  return mesh;
}

}  // namespace

Mesh make_car(Random& random) {
  // Vans are rarer than cars.
  CarBody car = car_bodies[random.chance(0.12) ? 3 : random.index(3)];
  const auto scale = static_cast<float>(random.uniform(0.95, 1.05));
  car.length *= scale;
  return make_car(car);
}

Mesh make_truck(Random& random) {
  Mesh mesh;
  const float front = static_cast<float>(random.uniform(3.6, 4.6));
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
  add_plates(mesh, front, -front);
  return mesh;
}

Mesh make_bus() {
  Mesh mesh;
  const float front = 5.2F;
  const float half = 1.27F;
  add_box(mesh, {-front, -half, 0.35F}, {front, half, 1.25F}, Surface::paint);
  add_box(mesh, {-front + 0.1F, -half + 0.04F, 1.25F}, {front - 0.06F, half - 0.04F, 2.5F},
          Surface::glass);
  for (float x = -front; x < front; x += 1.45F) {
    add_box(mesh, {x, -half, 1.25F}, {x + 0.16F, half, 2.5F}, Surface::paint);
  }
  add_box(mesh, {-front, -half, 2.5F}, {front, half, 3.05F}, Surface::paint);
  add_box(mesh, {-2.5F, -0.8F, 3.05F}, {0.5F, 0.8F, 3.25F}, Surface::paint);
  add_axle(mesh, front - 2.6F, half + 0.01F, 0.48F);
  add_axle(mesh, -front + 3.0F, half + 0.01F, 0.48F);
  add_plates(mesh, front, -front);
  return mesh;
}

}  // namespace stillmap
