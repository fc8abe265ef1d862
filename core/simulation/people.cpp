#include <cmath>
#include <numbers>
#include <utility>

#include "core/simulation/object_shapes.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

void add_limb(Mesh& mesh, const Vector3f& a, const Vector3f& b, float radius, Surface surface) {
  add_tube(mesh, {a, b, radius, 0.8F * radius, 6}, surface);
}

// An open ring with spokes, which rays can pass.
void add_wheel(Mesh& mesh, float x, float radius, float thickness) {
  constexpr int pieces = 12;
  const auto rim = [&](int i) -> Vector3f {
    const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / pieces;
    return {x + radius * std::cos(angle), 0, radius + thickness + radius * std::sin(angle)};
  };
  for (int i = 0; i < pieces; ++i) {
    add_tube(mesh, {rim(i), rim(i + 1), thickness, thickness, 4}, Surface::tyre);
  }
  for (int i = 0; i < pieces; i += 3) {
    add_tube(mesh, {rim(i), rim(i + pieces / 2), 0.012F, 0.012F, 3}, Surface::paint);
  }
}

// A seated rider: hips at (x, z), hands and feet on the machine.
void add_rider(Mesh& mesh, float hip_x, float hip_z, const Vector3f& hand, const Vector3f& foot) {
  const Vector3f hip(hip_x, 0, hip_z);
  const Vector3f shoulder(hip_x + 0.28F, 0, hip_z + 0.52F);
  add_limb(mesh, hip, shoulder, 0.17F, Surface::cloth);
  add_ellipsoid(mesh, shoulder + Vector3f(0.08F, 0, 0.25F), {0.11F, 0.1F, 0.14F}, Surface::skin);
  for (const float side : {-1.0F, 1.0F}) {
    const Vector3f out(0, side * 0.12F, 0);
    const Vector3f knee = 0.5F * (hip + foot) + Vector3f(0.22F, 0, 0.1F) + out;
    const float pedal = side * 0.12F;
    add_limb(mesh, hip + out, knee, 0.08F, Surface::cloth);
    add_limb(mesh, knee, foot + out + Vector3f(pedal, 0, pedal), 0.06F, Surface::cloth);
    add_limb(mesh, shoulder + 1.5F * out, hand + 1.8F * out, 0.05F, Surface::cloth);
  }
}

// Scaled at random in length and height, about its foot.
Mesh stretched(Mesh mesh, Random& random) {
  const float length = random.between(0.92, 1.08);
  const float height = random.between(0.92, 1.08);
  for (Vector3f& vertex : mesh.vertices) {
    vertex.x() *= length;
    vertex.z() *= height;
  }
  return mesh;
}

Mesh plain_bicycle() {
  Mesh mesh;
  add_wheel(mesh, -0.52F, 0.32F, 0.022F);
  add_wheel(mesh, 0.52F, 0.32F, 0.022F);
  const Vector3f crank(-0.08F, 0, 0.3F);
  const Vector3f saddle(-0.25F, 0, 0.85F);
  const Vector3f head(0.38F, 0, 0.8F);
  const std::array<std::pair<Vector3f, Vector3f>, 6> tubes{{
      {crank, saddle},
      {crank, head},
      {saddle, head},
      {{-0.52F, 0, 0.34F}, crank},
      {{0.52F, 0, 0.34F}, {0.36F, 0, 1.0F}},
      {{0.36F, -0.28F, 1.0F}, {0.36F, 0.28F, 1.0F}},
  }};
  for (const auto& [a, b] : tubes) add_limb(mesh, a, b, 0.025F, Surface::paint);
  add_box(mesh, saddle - Vector3f(0.15F, 0.08F, 0), saddle + Vector3f(0.12F, 0.08F, 0.06F),
          Surface::tyre);
  return mesh;
}

Mesh plain_motorcycle(Random& random) {
  Mesh mesh;
  for (const float x : {-0.68F, 0.68F}) {
    add_tube(mesh, {{x, -0.06F, 0.31F}, {x, 0.06F, 0.31F}, 0.31F, 0.31F, 12}, Surface::tyre);
  }
  const float seat = random.between(0.74, 0.9);
  const float girth = random.between(0.13, 0.24);
  add_frustum(mesh, {-0.6F, 0.4F, girth + 0.04F, 0.28F}, {-0.8F, 0.45F, girth, seat},
              Surface::paint, Surface::paint);
  if (random.chance(0.5)) {  // Fairing with a windscreen.
    add_frustum(mesh, {0.3F, 0.75F, 0.22F, 0.6F}, {0.3F, 0.5F, 0.16F, 1.2F}, Surface::paint,
                Surface::glass);
  }
  if (random.chance(0.4)) {
    add_box(mesh, {-0.95F, -0.2F, seat}, {-0.6F, 0.2F, seat + 0.3F}, Surface::paint);
  }
  add_limb(mesh, {0.66F, 0, 0.33F}, {0.42F, 0, 1.0F}, 0.06F, Surface::paint);
  add_limb(mesh, {0.4F, -0.36F, 1.0F}, {0.4F, 0.36F, 1.0F}, 0.03F, Surface::tyre);
  return mesh;
}

Mesh make_person(Random& random) {
  Mesh mesh;
  // One in eight is a child.
  const double size = random.chance(0.12) ? random.uniform(0.6, 0.85) : random.uniform(0.9, 1.1);
  const float girth = random.between(0.85, 1.25);
  const float stride = random.between(0.02, 0.32);
  const float swing = random.between(0.0, 0.3);
  for (const float side : {-1.0F, 1.0F}) {
    const Vector3f hip(0, side * 0.09F, 0.88F);
    add_limb(mesh, hip, {side * stride, side * 0.1F, 0.02F}, 0.09F, Surface::cloth);
    add_limb(mesh, {0, side * 0.22F, 1.42F}, {-side * swing, side * 0.26F, 0.85F}, 0.055F,
             Surface::cloth);
  }
  add_ellipsoid(mesh, {0, 0, 1.17F}, {0.14F * girth, 0.22F * girth, 0.36F}, Surface::cloth);
  add_ellipsoid(mesh, {0.02F, 0, 1.63F}, {0.11F, 0.09F, 0.14F}, Surface::skin);
  const double wears = random.uniform();
  if (wears < 0.25) {
    add_tube(mesh, {{0, 0, 0.45F}, {0, 0, 1.2F}, 0.24F * girth, 0.19F * girth}, Surface::cloth);
  } else if (wears < 0.45) {
    add_box(mesh, {-0.32F, -0.15F, 1.0F}, {-0.12F, 0.15F, 1.45F}, Surface::cloth);
  } else if (wears < 0.55) {
    add_box(mesh, {-0.15F, 0.24F, 0.5F}, {0.2F, 0.36F, 0.85F}, Surface::cloth);
  }
  for (Vector3f& vertex : mesh.vertices) vertex *= static_cast<float>(size);
  return mesh;
}

Mesh make_bicyclist(Random& random) {
  Mesh mesh = plain_bicycle();
  add_rider(mesh, -0.22F, 0.98F, {0.34F, 0, 1.02F}, {-0.05F, 0, 0.3F});
  return stretched(std::move(mesh), random);
}

Mesh make_motorcyclist(Random& random) {
  Mesh mesh = plain_motorcycle(random);
  add_rider(mesh, -0.3F, 0.95F, {0.36F, 0, 1.02F}, {0.05F, 0, 0.38F});
  return stretched(std::move(mesh), random);
}

}  // namespace

Mesh make_person_or_two_wheeler(ObjectKind kind, Random& random) {
  switch (kind) {
    case ObjectKind::bicycle:
      return stretched(plain_bicycle(), random);
    case ObjectKind::motorcycle:
      return stretched(plain_motorcycle(random), random);
    case ObjectKind::bicyclist:
      return make_bicyclist(random);
    case ObjectKind::motorcyclist:
      return make_motorcyclist(random);
    default:
      return make_person(random);
  }
}

}  // namespace stillmap::simulation
