#include <algorithm>
#include <cmath>

#include "core/simulation/city_shapes.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

constexpr float floor_m = 3.0F;
constexpr float foundation_m = 3.0F;

// A vertical wall as a frame: `across` along it, `out` its outward normal.
struct Wall {
  Vector3f corner, across, out;
  float length_m;

  [[nodiscard]] Vector3f at(float along, float height, float outwards = 0.0F) const {
    return corner + along * across + height * Vector3f::UnitZ() + outwards * out;
  }
};

// Rectangle in a wall.
struct Opening {
  float left, right, bottom, top;
};

void add_plate(Mesh& mesh, const Wall& wall, const Opening& o, float outwards, Surface surface) {
  mesh.add_quad(wall.at(o.left, o.bottom, outwards), wall.at(o.right, o.bottom, outwards),
                wall.at(o.right, o.top, outwards), wall.at(o.left, o.top, outwards), surface);
}

// Block that protrudes from the wall by `outwards`: sill, pilaster, balcony; recess where negative.
void add_relief(Mesh& mesh, const Wall& wall, const Opening& o, float outwards, Surface surface) {
  add_plate(mesh, wall, o, outwards, surface);
  for (const float side : {o.left, o.right}) {
    mesh.add_quad(wall.at(side, o.bottom), wall.at(side, o.bottom, outwards),
                  wall.at(side, o.top, outwards), wall.at(side, o.top), surface);
  }
  for (const float level : {o.bottom, o.top}) {
    mesh.add_quad(wall.at(o.left, level), wall.at(o.right, level),
                  wall.at(o.right, level, outwards), wall.at(o.left, level, outwards), surface);
  }
}

// The wall of one bay with a recessed opening in it.
void add_pierced_bay(Mesh& mesh, const Wall& wall, const Opening& bay, const Opening& hole,
                     float recess_m, Surface surface, Surface pane) {
  add_plate(mesh, wall, {bay.left, hole.left, bay.bottom, bay.top}, 0, surface);
  add_plate(mesh, wall, {hole.right, bay.right, bay.bottom, bay.top}, 0, surface);
  add_plate(mesh, wall, {hole.left, hole.right, bay.bottom, hole.bottom}, 0, surface);
  add_plate(mesh, wall, {hole.left, hole.right, hole.top, bay.top}, 0, surface);
  add_relief(mesh, wall, hole, -recess_m, surface);
  add_plate(mesh, wall, hole, -recess_m + 0.01F, pane);
}

void add_balcony(Mesh& mesh, const Wall& wall, const Opening& bay) {
  const float depth = 1.2F;
  const Opening slab{bay.left + 0.1F, bay.right - 0.1F, bay.bottom - 0.1F, bay.bottom + 0.1F};
  add_relief(mesh, wall, slab, depth, Surface::plaster);
  const Opening rail{slab.left, slab.right, slab.top, slab.top + 0.95F};
  add_plate(mesh, wall, rail, depth, Surface::roof);
}

void add_facade(Mesh& mesh, const Wall& wall, const BuildingPlan& plan, Random& random) {
  const int bays = std::max(1, static_cast<int>(wall.length_m / 2.9F));
  const float bay_m = wall.length_m / static_cast<float>(bays);
  const float height = floor_m * static_cast<float>(plan.floors);
  const auto recess = random.between(0.12, 0.3);
  const bool pilasters = random.chance(0.5);
  const std::size_t door = random.index(static_cast<std::size_t>(bays));
  add_plate(mesh, wall, {0, wall.length_m, -foundation_m, 0}, 0, plan.wall);
  for (int i = 0; i < bays; ++i) {
    const float left = bay_m * static_cast<float>(i);
    const bool balcony = plan.balconies && random.chance(0.4);
    for (int level = 0; level < plan.floors; ++level) {
      const float bottom = floor_m * static_cast<float>(level);
      const Opening bay{left, left + bay_m, bottom, bottom + floor_m};
      const bool is_door = level == 0 && static_cast<std::size_t>(i) == door;
      const float sill = is_door ? 0.1F : 0.9F;
      const Opening hole{left + 0.28F * bay_m, left + 0.72F * bay_m, bottom + sill, bottom + 2.4F};
      if (!is_door && plan.share_windows < 1.0F && !random.chance(plan.share_windows)) {
        add_plate(mesh, wall, bay, 0, plan.wall);
        continue;
      }
      add_pierced_bay(mesh, wall, bay, hole, is_door ? 0.5F : recess, plan.wall,
                      is_door ? Surface::brick : Surface::window);
      if (balcony && level > 0) add_balcony(mesh, wall, bay);
      if (!is_door) {
        const Opening ledge{hole.left - 0.1F, hole.right + 0.1F, hole.bottom - 0.1F, hole.bottom};
        add_relief(mesh, wall, ledge, 0.12F, plan.wall);
      }
    }
    if (pilasters) add_relief(mesh, wall, {left, left + 0.4F, 0, height}, 0.18F, plan.wall);
  }
  add_relief(mesh, wall, {0, wall.length_m, 0, 0.5F}, 0.08F, Surface::brick);
  add_relief(mesh, wall, {0, wall.length_m, height - 0.3F, height}, 0.25F, plan.wall);
}

void add_flat_roof(Mesh& mesh, float half_width, float half_depth, float height, Random& random) {
  const Vector3f low(-half_width, -half_depth, height);
  add_box(mesh, low, {half_width, half_depth, height + 0.1F}, Surface::roof);
  for (const float side : {-1.0F, 1.0F}) {
    const float y = side * (half_depth - 0.15F);
    add_box(mesh, {-half_width, y - 0.15F, height}, {half_width, y + 0.15F, height + 0.9F},
            Surface::plaster);
  }
  const auto x = random.between(-0.5, 0.5) * half_width;
  add_box(mesh, {x - 1.5F, -1.5F, height}, {x + 1.5F, 1.5F, height + 2.5F}, Surface::brick);
}

void add_gabled_roof(Mesh& mesh, float half_width, float half_depth, float height,
                     const BuildingPlan& plan) {
  const float eaves = 0.5F;
  const float ridge = height + 0.75F * half_depth;
  const float x = half_width + 0.4F;
  const float y = half_depth + eaves;
  const float low = height - 0.75F * eaves;
  for (const float side : {-1.0F, 1.0F}) {
    mesh.add_quad({-x, side * y, low}, {x, side * y, low}, {x, 0, ridge}, {-x, 0, ridge},
                  Surface::roof);
    const float gable = side * half_width;
    mesh.add_triangle({gable, -half_depth, height}, {gable, half_depth, height}, {gable, 0, ridge},
                      plan.wall);
  }
  add_box(mesh, {0.4F * half_width, 0.5F, height}, {0.4F * half_width + 0.7F, 1.2F, ridge + 0.8F},
          Surface::brick);
}

// A roof on two posts.
void add_porch(Mesh& house, float x, float front, Random& random) {
  const float depth = random.between(0.8, 2.0);
  const float half = random.between(0.7, 1.4);
  add_box(house, {x - half, front - depth, 2.4F}, {x + half, front, 2.6F}, Surface::roof);
  for (const float side : {-half + 0.1F, half - 0.1F}) {
    add_tube(house,
             {{x + side, front - depth + 0.1F, -0.3F},
              {x + side, front - depth + 0.1F, 2.4F},
              0.06F,
              0.06F,
              6},
             Surface::plaster);
  }
}

void add_steps(Mesh& house, float x, float front, Random& random) {
  const std::size_t steps = 1 + random.index(4);
  const float half = random.between(0.5, 1.0);
  for (std::size_t i = 0; i < steps; ++i) {
    const auto n = static_cast<float>(i);
    const auto rest = static_cast<float>(steps) - n;
    add_box(house, {x - half, front - 0.3F * rest, -0.5F}, {x + half, front, 0.17F * (n + 1.0F)},
            Surface::other_structure);
  }
  if (!random.chance(0.5)) return;
  const float way = 0.3F * static_cast<float>(steps);
  for (const float side : {-half, half}) {
    add_tube(house, {{x + side, front - way, 0.9F}, {x + side, front, 1.5F}, 0.02F, 0.02F, 4},
             Surface::other_structure);
    add_tube(house,
             {{x + side, front - way, -0.3F}, {x + side, front - way, 0.9F}, 0.02F, 0.02F, 4},
             Surface::other_structure);
  }
}

void add_bay_window(Mesh& house, const BuildingPlan& plan, float x, float front, Random& random) {
  const float depth = random.between(0.4, 1.2);
  const float half = random.between(0.9, 1.8);
  const float top =
      floor_m * static_cast<float>(1 + random.index(static_cast<std::size_t>(plan.floors)));
  add_box(house, {x - half, front - depth, -1.0F}, {x + half, front, top - 0.2F}, plan.wall);
  add_box(house, {x - half + 0.2F, front - depth - 0.02F, 0.9F},
          {x + half - 0.2F, front - depth - 0.01F, 2.3F}, Surface::window);
}

void add_garage(Mesh& house, float x, float front, Random& random) {
  const float half = random.between(1.4, 2.8);
  const float ahead = random.between(0.3, 2.5);
  add_box(house, {x - half, front - ahead, -1.0F}, {x + half, front, 2.5F}, Surface::plaster);
  add_box(house, {x - half + 0.2F, front - ahead - 0.03F, 0.0F},
          {x + half - 0.2F, front - ahead - 0.01F, 2.1F}, Surface::plaster);
  add_box(house, {x - half - 0.2F, front - ahead - 0.3F, 2.5F}, {x + half + 0.2F, front, 2.7F},
          Surface::roof);
}

// Attached to the front of a house: porch, steps, bay window, garage, rain pipe.
void add_outbuildings(Mesh& house, const BuildingPlan& plan, Random& random) {
  const float front = -0.5F * plan.depth_m;
  const float reach = std::max(0.1F, 0.5F * plan.width_m - 2.0F);
  const auto somewhere = [&] { return random.between(-reach, reach); };
  if (random.chance(0.35)) add_porch(house, somewhere(), front, random);
  if (random.chance(0.35)) add_steps(house, somewhere(), front, random);
  if (random.chance(0.3)) add_bay_window(house, plan, somewhere(), front, random);
  if (random.chance(0.2)) add_garage(house, somewhere(), front, random);
  if (random.chance(0.4)) {  // Rain pipe.
    const float x = somewhere();
    add_tube(house,
             {{x, front - 0.06F, 0},
              {x, front - 0.06F, floor_m * static_cast<float>(plan.floors)},
              0.05F,
              0.05F,
              6},
             plan.wall);
  }
}

}  // namespace

Mesh make_building(const BuildingPlan& plan, Random random) {
  Mesh mesh;
  const float x = 0.5F * plan.width_m;
  const float y = 0.5F * plan.depth_m;
  const std::array<Wall, 4> walls{{
      {{-x, -y, 0}, {1, 0, 0}, {0, -1, 0}, plan.width_m},
      {{x, -y, 0}, {0, 1, 0}, {1, 0, 0}, plan.depth_m},
      {{x, y, 0}, {-1, 0, 0}, {0, 1, 0}, plan.width_m},
      {{-x, y, 0}, {0, -1, 0}, {-1, 0, 0}, plan.depth_m},
  }};
  for (const Wall& wall : walls) add_facade(mesh, wall, plan, random);
  const float height = floor_m * static_cast<float>(plan.floors);
  if (plan.gabled) {
    add_gabled_roof(mesh, x, y, height, plan);
  } else {
    add_flat_roof(mesh, x, y, height, random);
  }
  if (plan.outbuildings) add_outbuildings(mesh, plan, random);
  return mesh;
}

}  // namespace stillmap::simulation
