#include "core/simulation/city_shapes.hpp"

namespace stillmap::simulation {
namespace {

constexpr float buried_m = -0.3F;

void add_pole(Mesh& mesh, float height_m, float radius_m) {
  add_tube(mesh, {{0, 0, buried_m}, {0, 0, height_m}, radius_m, 0.8F * radius_m}, Surface::pole);
}

void add_arm(Mesh& mesh, float height, float reach) {
  const float lamp = reach > 0.0F ? reach - 0.6F : reach;
  add_tube(mesh, {{0, 0, height - 0.3F}, {reach, 0, height}, 0.04F, 0.03F, 6}, Surface::pole);
  add_box(mesh, {lamp, -0.13F, height - 0.04F}, {lamp + 0.6F, 0.13F, height + 0.1F}, Surface::pole);
}

void add_plate(Mesh& mesh, float z, float half, std::size_t shape) {
  constexpr float ahead = 0.05F;
  if (shape == 0) {
    add_tube(mesh, {{0, ahead - 0.01F, z}, {0, ahead, z}, half, half, 12}, Surface::sign_face);
  } else if (shape == 1) {
    mesh.add_triangle({-1.2F * half, ahead, z - half}, {1.2F * half, ahead, z - half},
                      {0, ahead, z + half}, Surface::sign_face);
  } else {
    const float wide = shape == 2 ? half : 1.9F * half;
    add_box(mesh, {-wide, ahead - 0.01F, z - half}, {wide, ahead, z + half}, Surface::sign_face);
  }
}

// A large board on two posts.
void add_board(Mesh& mesh, Random& random) {
  const float wide = random.between(0.6, 1.8);
  const float low = random.between(0.5, 2.2);
  const float high = low + random.between(0.6, 1.6);
  for (const float x : {-0.7F * wide, 0.7F * wide}) {
    add_tube(mesh, {{x, 0, buried_m}, {x, 0, high}, 0.05F, 0.05F}, Surface::pole);
  }
  add_box(mesh, {-wide, 0.06F, low}, {wide, 0.09F, high}, Surface::sign_face);
}

void add_bench(Mesh& mesh, Random& random) {
  const float half = random.between(0.6, 1.1);
  add_box(mesh, {-0.25F, -half, 0.4F}, {0.25F, half, 0.46F}, Surface::street_object);
  for (const float y : {-0.8F * half, 0.8F * half}) {
    add_box(mesh, {-0.22F, y - 0.04F, buried_m}, {0.22F, y + 0.04F, 0.4F}, Surface::street_object);
  }
  if (!random.chance(0.6)) return;
  add_box(mesh, {-0.3F, -half, 0.55F}, {-0.25F, half, 0.85F}, Surface::street_object);
}

void add_bins(Mesh& mesh, Random& random) {
  const std::size_t count = 1 + random.index(4);
  const float size = random.between(0.5, 1.1);
  for (std::size_t i = 0; i < count; ++i) {
    const float y = 0.75F * static_cast<float>(i) + random.between(-0.05, 0.05);
    const float half = 0.27F * random.between(0.9, 1.1);
    Mesh bin;
    add_frustum(bin, {-0.28F, 0.28F, half, 0.05F}, {-0.35F, 0.35F, half, size},
                Surface::street_object, Surface::street_object);
    mesh.append(bin, Eigen::Isometry3f(Eigen::Translation3f(0, y, 0)));
  }
}

}  // namespace

Mesh make_street_light() {
  Mesh mesh;
  add_pole(mesh, 6.5F, 0.09F);
  add_tube(mesh, {{0, 0, 6.4F}, {1.6F, 0, 6.8F}, 0.05F, 0.04F, 6}, Surface::pole);
  add_box(mesh, {1.3F, -0.12F, 6.75F}, {2.0F, 0.12F, 6.9F}, Surface::pole);
  return mesh;
}

Mesh make_any_street_light(Random random) {
  Mesh mesh;
  const float height = random.between(3.0, 10.0);
  add_pole(mesh, height, random.between(0.03, 0.13));
  if (random.chance(0.4)) {  // Door of the switch box.
    add_tube(mesh, {{0, 0, buried_m}, {0, 0, 1.1F}, 0.12F, 0.12F}, Surface::pole);
  }
  const double kind = random.uniform();
  if (kind < 0.3) {
    add_ellipsoid(mesh, {0, 0, height}, {0.22F, 0.22F, 0.3F}, Surface::pole);
  } else {
    add_arm(mesh, height, random.between(0.5, 2.5));
    if (kind > 0.8) add_arm(mesh, height, -random.between(0.5, 2.5));
  }
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
  const float height = random.between(2.1, 2.5);
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

Mesh make_any_sign(Random random) {
  Mesh mesh;
  if (random.chance(0.12)) {
    add_board(mesh, random);
    return mesh;
  }
  const std::size_t plates = 1 + random.index(3);
  float z = random.between(1.8, 2.8);
  const float foot = z;
  for (std::size_t i = 0; i < plates; ++i) {
    const float half = random.between(0.2, 0.48);
    add_plate(mesh, z + half, half, random.index(4));
    z += 2.0F * half + 0.05F;
  }
  add_pole(mesh, random.chance(0.2) ? foot + random.between(1.0, 3.0) : z,
           random.between(0.025, 0.06));
  return mesh;
}

Mesh make_bollard() {
  Mesh mesh;
  add_pole(mesh, 0.95F, 0.08F);
  return mesh;
}

Mesh make_any_pole(Random random) {
  Mesh mesh;
  const float radius = random.between(0.02, random.chance(0.3) ? 0.15 : 0.08);
  add_pole(mesh, random.chance(0.5) ? random.between(0.6, 1.2) : random.between(1.8, 9.0), radius);
  return mesh;
}

Mesh make_street_object(Random random) {
  Mesh mesh;
  switch (random.index(4)) {
    case 0:
      add_bench(mesh, random);
      break;
    case 1:
      add_bins(mesh, random);
      break;
    case 2: {  // Junction box.
      const float half = random.between(0.25, 0.8);
      add_box(mesh, {-0.2F, -half, buried_m}, {0.2F, half, random.between(0.7, 1.5)},
              Surface::street_object);
      break;
    }
    default: {  // Advertising column or planter.
      const bool tall = random.chance(0.4);
      const float radius = tall ? random.between(0.5, 0.7) : random.between(0.2, 0.6);
      add_tube(
          mesh,
          {{0, 0, buried_m}, {0, 0, tall ? 3.2F : random.between(0.4, 1.0)}, radius, radius, 12},
          Surface::street_object);
    }
  }
  return mesh;
}

Mesh make_shelter(Random random) {
  Mesh mesh;
  const float half = random.between(1.2, 2.4);
  add_box(mesh, {-0.9F, -half, 2.3F}, {0.9F, half, 2.4F}, Surface::other_structure);
  for (const float y : {-half + 0.1F, half - 0.1F}) {
    for (const float x : {-0.75F, 0.7F}) {
      add_tube(mesh, {{x, y, buried_m}, {x, y, 2.3F}, 0.05F, 0.05F, 6}, Surface::other_structure);
    }
  }
  add_box(mesh, {-0.78F, -half, 0.2F}, {-0.74F, half, 2.1F}, Surface::other_structure);
  add_box(mesh, {-0.6F, -0.7F * half, 0.42F}, {-0.25F, 0.7F * half, 0.48F},
          Surface::other_structure);
  return mesh;
}

}  // namespace stillmap::simulation
