#include "core/simulation/vegetation.hpp"

#include <cmath>
#include <numbers>

#include "core/simulation/leaves.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

}  // namespace

Mesh make_tree(Random random) {
  Mesh mesh;
  const auto trunk_m = static_cast<float>(random.uniform(2.2, 3.4));
  const auto spread_m = static_cast<float>(random.uniform(1.3, 2.2));
  const auto radius_m = static_cast<float>(random.uniform(0.12, 0.24));
  const Vector3f fork(0.1F, 0.05F, trunk_m);
  add_tube(mesh, {{0, 0, -0.3F}, fork, 1.2F * radius_m, 0.8F * radius_m}, Surface::bark);
  const int blobs = 4 + static_cast<int>(random.index(3));
  for (int i = 0; i < blobs; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / blobs + random.uniform(-0.4, 0.4);
    const Eigen::Vector3d reach(std::cos(angle) * 0.6, std::sin(angle) * 0.6,
                                random.uniform(0.4, 1.6));
    const Vector3f blob = fork + spread_m * reach.cast<float>();
    add_tube(mesh, {fork, blob, 0.4F * radius_m, 0.1F * radius_m, 5}, Surface::bark);
    const auto size = static_cast<float>(random.uniform(0.6, 0.85)) * spread_m;
    add_leaf_ball(mesh, blob, {size, size, 0.8F * size}, {}, random);
  }
  return mesh;
}

Mesh make_bush(float size_m, Random random) {
  Mesh mesh;
  const Vector3f radii(0.5F * size_m, 0.5F * size_m, 0.45F * size_m);
  add_leaf_ball(mesh, {0, 0, 0.4F * size_m}, radii,
                {.leaves = static_cast<int>(260.0F * size_m), .leaf_m = 0.12F}, random);
  return mesh;
}

Mesh make_hedge(float length_m, float height_m, float depth_m, Random random) {
  Mesh mesh;
  const auto leaves = static_cast<int>(150.0F * length_m * height_m);
  for (int i = 0; i < leaves; ++i) {
    const Eigen::Vector3d spot(random.uniform(0.0, length_m), random.uniform(-0.5, 0.5) * depth_m,
                               random.uniform(0.02, 1.0) * height_m);
    add_leaf(mesh, spot.cast<float>(), 0.12F, random, Surface::hedge);
  }
  // The twigs inside: nothing is seen through a hedge below its top.
  add_box(mesh, {0, -0.3F * depth_m, -0.3F}, {length_m, 0.3F * depth_m, 0.85F * height_m},
          Surface::hedge);
  return mesh;
}

}  // namespace stillmap::simulation
