// What is built onto the front of a house.
#include <algorithm>

#include "core/simulation/buildings.hpp"

namespace stillmap::simulation {
namespace {

float between(Random& random, double low, double high) {
  return static_cast<float>(random.uniform(low, high));
}

// A roof on two posts over some steps.
void add_porch(Mesh& house, float x, float front, Random& random) {
  const float depth = between(random, 0.8, 2.0);
  const float half = between(random, 0.7, 1.4);
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
  const float half = between(random, 0.5, 1.0);
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
  const float depth = between(random, 0.4, 1.2);
  const float half = between(random, 0.9, 1.8);
  const float top =
      3.0F * static_cast<float>(1 + random.index(static_cast<std::size_t>(plan.floors)));
  add_box(house, {x - half, front - depth, -1.0F}, {x + half, front, top - 0.2F}, plan.wall);
  add_box(house, {x - half + 0.2F, front - depth - 0.02F, 0.9F},
          {x + half - 0.2F, front - depth - 0.01F, 2.3F}, Surface::window);
}

void add_garage(Mesh& house, float x, float front, Random& random) {
  const float half = between(random, 1.4, 2.8);
  const float ahead = between(random, 0.3, 2.5);
  add_box(house, {x - half, front - ahead, -1.0F}, {x + half, front, 2.5F}, Surface::plaster);
  add_box(house, {x - half + 0.2F, front - ahead - 0.03F, 0.0F},
          {x + half - 0.2F, front - ahead - 0.01F, 2.1F}, Surface::plaster);
  add_box(house, {x - half - 0.2F, front - ahead - 0.3F, 2.5F}, {x + half + 0.2F, front, 2.7F},
          Surface::roof);
}

}  // namespace

void add_outbuildings(Mesh& house, const BuildingPlan& plan, Random& random) {
  const float front = -0.5F * plan.depth_m;
  const float reach = std::max(0.1F, 0.5F * plan.width_m - 2.0F);
  const auto somewhere = [&] { return between(random, -reach, reach); };
  if (random.chance(0.35)) add_porch(house, somewhere(), front, random);
  if (random.chance(0.35)) add_steps(house, somewhere(), front, random);
  if (random.chance(0.3)) add_bay_window(house, plan, somewhere(), front, random);
  if (random.chance(0.2)) add_garage(house, somewhere(), front, random);
  if (random.chance(0.4)) {  // A rain pipe.
    const float x = somewhere();
    add_tube(house,
             {{x, front - 0.06F, 0},
              {x, front - 0.06F, 3.0F * static_cast<float>(plan.floors)},
              0.05F,
              0.05F,
              6},
             plan.wall);
  }
}

}  // namespace stillmap::simulation
