#include <algorithm>

#include "core/simulation/city_shapes.hpp"

namespace stillmap::simulation {
namespace {

// z of the foot, of any shape and of the plain ones [m].
constexpr float buried_m = -0.5F;
constexpr float shallow_m = -0.3F;

void add_posts(Mesh& mesh, float length_m, float height, float radius, Surface surface) {
  for (float x = 0.0F; x < length_m - 0.1F; x += 0.5F * length_m) {
    add_tube(mesh, {{x, 0, buried_m}, {x, 0, height}, radius, radius, 6}, surface);
  }
}

void add_bar(Mesh& mesh, float length_m, float z, float half, Surface surface) {
  add_box(mesh, {0, -half, z - half}, {length_m, half, z + half}, surface);
}

// Wires and gaps, as small quads that cover a random share of the field.
void add_wire_mesh(Mesh& mesh, float length_m, float height, Random& random) {
  const float cover = random.between(0.25, 0.7);
  constexpr float cell_m = 0.07F;
  for (float x = 0.0F; x < length_m; x += cell_m) {
    for (float z = 0.05F; z < height; z += cell_m) {
      if (!random.chance(static_cast<double>(cover))) continue;
      mesh.add_quad({x, 0, z}, {x + cell_m, 0, z}, {x + cell_m, 0, z + cell_m}, {x, 0, z + cell_m},
                    Surface::fence_mesh);
    }
  }
  add_posts(mesh, length_m, height + 0.1F, 0.03F, Surface::fence_metal);
}

void add_pickets(Mesh& mesh, float length_m, float height, Random& random) {
  const float board = random.between(0.05, 0.16);
  const float gap = random.between(0.0, 0.12);
  for (float x = 0.0F; x + board < length_m; x += board + gap) {
    add_box(mesh, {x, -0.01F, 0.06F}, {x + board, 0.01F, height}, Surface::fence_wood);
  }
  for (const float part : {0.25F, 0.8F}) {
    add_box(mesh, {0, -0.05F, part * height}, {length_m, -0.01F, part * height + 0.08F},
            Surface::fence_wood);
  }
  add_posts(mesh, length_m, height, 0.05F, Surface::fence_wood);
}

void add_planks(Mesh& mesh, float length_m, float height, Random& random) {
  const float board = random.between(0.1, 0.2);
  const float gap = random.between(0.0, 0.2);
  for (float z = 0.1F; z + board < height; z += board + gap) {
    add_box(mesh, {0, -0.015F, z}, {length_m, 0.015F, z + board}, Surface::fence_wood);
  }
  add_posts(mesh, length_m, height, 0.06F, Surface::fence_wood);
}

void add_railing(Mesh& mesh, float length_m, float height, Random& random) {
  const float step = random.between(0.1, 0.2);
  const float rod = random.between(0.008, 0.02);
  for (float x = 0.0F; x < length_m; x += step) {
    add_box(mesh, {x - rod, -rod, 0.1F}, {x + rod, rod, height}, Surface::fence_metal);
  }
  add_bar(mesh, length_m, height, 0.025F, Surface::fence_metal);
  add_bar(mesh, length_m, 0.12F, 0.02F, Surface::fence_metal);
  add_posts(mesh, length_m, height, 0.035F, Surface::fence_metal);
}

void add_rails(Mesh& mesh, float length_m, float height, Random& random) {
  const float half = random.between(0.02, 0.08);
  for (const float part : {0.5F, 0.95F}) {
    add_bar(mesh, length_m, part * height, half, Surface::fence_metal);
  }
  add_posts(mesh, length_m, height, 0.05F, Surface::fence_metal);
}

// Posts between which wires are too thin to be seen.
void add_lone_posts(Mesh& mesh, float length_m, float height, Random& random) {
  const float step = random.between(0.6, 2.5);
  const float radius = random.between(0.03, 0.08);
  for (float x = 0.0F; x < length_m; x += step) {
    const float lean = random.between(-0.1, 0.1);
    add_tube(mesh, {{x, 0, buried_m}, {x + lean, lean, height}, radius, radius, 6},
             Surface::fence_wood);
  }
}

}  // namespace

Mesh make_wooden_fence(float length_m) {
  Mesh mesh;
  add_box(mesh, {0, -0.05F, shallow_m}, {0.1F, 0.05F, 1.35F}, Surface::fence_wood);
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
  add_box(mesh, {0, -0.04F, shallow_m}, {0.08F, 0.04F, 1.5F}, Surface::fence_metal);
  add_box(mesh, {0, -0.1F, shallow_m}, {length_m, 0.1F, 0.3F}, Surface::fence_metal);
  for (float x = 0.12F; x < length_m; x += 0.12F) {
    add_box(mesh, {x, -0.015F, 0.3F}, {x + 0.03F, 0.015F, 1.45F}, Surface::fence_metal);
  }
  add_box(mesh, {0, -0.025F, 1.4F}, {length_m, 0.025F, 1.45F}, Surface::fence_metal);
  return mesh;
}

Mesh make_garden_wall(float length_m) {
  Mesh mesh;
  add_box(mesh, {0, -0.12F, shallow_m}, {length_m, 0.12F, 1.1F}, Surface::garden_wall);
  add_box(mesh, {0, -0.18F, shallow_m}, {0.36F, 0.18F, 1.35F}, Surface::garden_wall);
  return mesh;
}

Mesh make_any_crash_barrier(float length_m, Random random) {
  Mesh mesh;
  if (random.chance(0.6)) {
    const float low = random.between(0.35, 0.55);
    for (const float y : {-0.06F, 0.02F}) {
      add_box(mesh, {0, y, low}, {length_m, y + 0.04F, low + 0.14F}, Surface::fence_metal);
      add_box(mesh, {0, y, low + 0.17F}, {length_m, y + 0.04F, low + 0.31F}, Surface::fence_metal);
    }
    add_posts(mesh, length_m, low + 0.25F, 0.05F, Surface::fence_metal);
    return mesh;
  }
  const float half = 0.5F * length_m;
  Mesh barrier;
  add_frustum(barrier, {-half, half, 0.3F, buried_m}, {-half, half, 0.1F, 0.85F},
              Surface::garden_wall, Surface::garden_wall);
  mesh.append(barrier, Eigen::Isometry3f(Eigen::Translation3f(half, 0, 0)));
  return mesh;
}

Mesh make_any_fence(float length_m, Random random) {
  Mesh mesh;
  const float height = random.between(0.8, random.chance(0.5) ? 2.4 : 1.6);
  if (random.chance(0.2)) {
    add_box(mesh, {0, -0.1F, buried_m}, {length_m, 0.1F, 0.25F * height}, Surface::garden_wall);
  }
  switch (random.index(7)) {
    case 0:
      add_wire_mesh(mesh, length_m, height, random);
      break;
    case 1:
      add_pickets(mesh, length_m, height, random);
      break;
    case 2:
      add_planks(mesh, length_m, height, random);
      break;
    case 3:
      add_railing(mesh, length_m, height, random);
      break;
    case 4:
      mesh.append(make_any_crash_barrier(length_m, random), Eigen::Isometry3f::Identity());
      break;
    case 5:
      add_lone_posts(mesh, length_m, std::min(height, 1.6F), random);
      break;
    default:
      add_rails(mesh, length_m, height, random);
  }
  return mesh;
}

Mesh make_any_wall(float length_m, Random random) {
  Mesh mesh;
  const float height = random.between(0.4, random.chance(0.5) ? 2.8 : 1.5);
  const float half = random.between(0.08, 0.22);
  add_box(mesh, {0, -half, buried_m - 1.0F}, {length_m, half, height}, Surface::garden_wall);
  if (random.chance(0.4)) {
    const float pier = half + 0.06F;
    add_box(mesh, {0, -pier, buried_m}, {3.0F * pier, pier, height + 0.2F}, Surface::garden_wall);
  }
  if (random.chance(0.25)) {
    add_bar(mesh, length_m, height + 0.4F, 0.03F, Surface::fence_metal);
    add_posts(mesh, length_m, height + 0.4F, 0.03F, Surface::fence_metal);
  }
  return mesh;
}

}  // namespace stillmap::simulation
