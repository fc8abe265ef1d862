#include <array>

#include "core/simulation/vehicle_parts.hpp"
#include "core/simulation/vehicles.hpp"

namespace stillmap::simulation {
namespace {

float between(Random& random, double low, double high) {
  return static_cast<float>(random.uniform(low, high));
}

Mesh make_caravan(Random& random) {
  Mesh mesh;
  const float half = between(random, 1.9, 2.9);
  const float top = between(random, 2.3, 2.7);
  const float slant = between(random, 0.1, 0.5);
  const std::array<Eigen::Vector2f, 6> side{{{-half, 0.45F},
                                             {half, 0.45F},
                                             {half, 1.2F},
                                             {half - slant, top},
                                             {-half + 0.15F, top},
                                             {-half, 1.2F}}};
  const float half_width = between(random, 1.0, 1.2);
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
  const float half = between(random, 0.9, 2.2);
  const float half_width = between(random, 0.65, 1.0);
  const float rim = between(random, 0.75, 1.1);
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
  const float big = between(random, 0.65, 0.9);
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
  const Eigen::Vector3f elbow(between(random, 2.0, 3.0), 0, between(random, 2.8, 3.8));
  const Eigen::Vector3f hand(between(random, 3.4, 4.6), 0, between(random, 0.6, 1.6));
  add_tube(mesh, {{0.9F, 0, 1.4F}, elbow, 0.25F, 0.2F, 6}, Surface::paint);
  add_tube(mesh, {elbow, hand, 0.2F, 0.13F, 6}, Surface::paint);
  add_box(mesh, hand - Eigen::Vector3f(0.5F, 0.6F, 0.5F), hand + Eigen::Vector3f(0.3F, 0.6F, 0.2F),
          Surface::paint);
  return mesh;
}

}  // namespace

Mesh make_other_vehicle(Random& random) {
  const double kind = random.uniform();
  if (kind < 0.35) return make_caravan(random);
  if (kind < 0.65) return make_trailer(random);
  return kind < 0.85 ? make_tractor(random) : make_digger(random);
}

}  // namespace stillmap::simulation
