#include "core/simulation/street_furniture.hpp"

namespace stillmap::simulation {
namespace {

constexpr float buried_m = -0.3F;

void add_pole(Mesh& mesh, float height_m, float radius_m) {
  add_tube(mesh, {{0, 0, buried_m}, {0, 0, height_m}, radius_m, 0.8F * radius_m}, Surface::pole);
}

}  // namespace

Mesh make_street_light() {
  Mesh mesh;
  add_pole(mesh, 6.5F, 0.09F);
  add_tube(mesh, {{0, 0, 6.4F}, {1.6F, 0, 6.8F}, 0.05F, 0.04F, 6}, Surface::pole);
  add_box(mesh, {1.3F, -0.12F, 6.75F}, {2.0F, 0.12F, 6.9F}, Surface::pole);
  return mesh;
}

Mesh make_traffic_light() {
  Mesh mesh;
  add_pole(mesh, 3.3F, 0.07F);
  add_box(mesh, {-0.15F, -0.02F, 2.4F}, {0.15F, 0.2F, 3.25F}, Surface::sign_back);
  return mesh;
}

Mesh make_sign(Random random) {
  Mesh mesh;
  const auto height = static_cast<float>(random.uniform(2.1, 2.5));
  add_pole(mesh, height + 0.3F, 0.035F);
  const std::size_t kind = random.index(3);
  if (kind == 0) {
    add_tube(mesh, {{0, 0.04F, height}, {0, 0.055F, height}, 0.32F, 0.32F, 12}, Surface::sign_face);
  } else if (kind == 1) {
    add_box(mesh, {-0.3F, 0.04F, height - 0.3F}, {0.3F, 0.055F, height + 0.3F}, Surface::sign_face);
  } else {
    const Eigen::Vector3f top(0, 0.05F, height + 0.3F);
    mesh.add_triangle({-0.42F, 0.05F, height - 0.4F}, {0.42F, 0.05F, height - 0.4F}, top,
                      Surface::sign_face);
  }
  return mesh;
}

Mesh make_bollard() {
  Mesh mesh;
  add_pole(mesh, 0.95F, 0.08F);
  return mesh;
}

Mesh make_wooden_fence(float length_m) {
  Mesh mesh;
  add_box(mesh, {0, -0.05F, buried_m}, {0.1F, 0.05F, 1.35F}, Surface::fence_wood);
  for (float x = 0.1F; x + 0.05F < length_m; x += 0.2F) {
    add_box(mesh, {x, -0.01F, 0.08F}, {x + 0.13F, 0.01F, 1.25F}, Surface::fence_wood);
  }
  for (const float z : {0.3F, 1.0F}) {
    add_box(mesh, {0, -0.04F, z}, {length_m, -0.01F, z + 0.08F}, Surface::fence_wood);
  }
  return mesh;
}

Mesh make_railing(float length_m) {
  Mesh mesh;
  add_box(mesh, {0, -0.04F, buried_m}, {0.08F, 0.04F, 1.5F}, Surface::fence_metal);
  add_box(mesh, {0, -0.1F, buried_m}, {length_m, 0.1F, 0.3F}, Surface::fence_metal);
  for (float x = 0.12F; x < length_m; x += 0.12F) {
    add_box(mesh, {x, -0.015F, 0.3F}, {x + 0.03F, 0.015F, 1.45F}, Surface::fence_metal);
  }
  add_box(mesh, {0, -0.025F, 1.4F}, {length_m, 0.025F, 1.45F}, Surface::fence_metal);
  return mesh;
}

Mesh make_garden_wall(float length_m) {
  Mesh mesh;
  add_box(mesh, {0, -0.12F, buried_m}, {length_m, 0.12F, 1.1F}, Surface::garden_wall);
  add_box(mesh, {0, -0.18F, buried_m}, {0.36F, 0.18F, 1.35F}, Surface::garden_wall);
  return mesh;
}

}  // namespace stillmap::simulation
