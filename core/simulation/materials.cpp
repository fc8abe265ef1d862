#include "core/simulation/materials.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace stillmap::simulation {
namespace {

// Random value, 0..1, constant within each cube of that size.
double shade(const Eigen::Vector3f& spot_map, double size_m) {
  const auto cell = [&](float x) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x / size_m)));
  };
  return Random(71, cell(spot_map.x()), cell(spot_map.y()), cell(spot_map.z())).uniform();
}

// Mostly little: grass is mown, and hedges are cut.
void draw_pile(Materials& materials, Surface surface, double min_m, double max_m, Random& random) {
  const double high = random.uniform();
  materials.properties[static_cast<std::size_t>(surface)].pile_m =
      static_cast<float>(min_m + (max_m - min_m) * high * high);
}

void draw_lost(Materials& materials, Surface surface, double min_lost, double max_lost,
               Random& random) {
  materials.properties[static_cast<std::size_t>(surface)].lost = random.between(min_lost, max_lost);
}

void draw_gloss(Materials& materials, Surface surface, double max_gloss, Random& random) {
  materials.properties[static_cast<std::size_t>(surface)].gloss = random.between(0.0, max_gloss);
}

// Water mirrors beams away.
void wet(Materials& materials, Random& random) {
  for (const Surface surface : {Surface::asphalt, Surface::parking_bay, Surface::lane_marking}) {
    SurfaceProperties& properties = materials.properties[static_cast<std::size_t>(surface)];
    properties.lost = random.between(0.05, 0.35);
    properties.reflectivity *= random.between(0.3, 0.8);
  }
}

// In the order of the enumeration.
constexpr std::array<SurfaceProperties, surface_count> table{{
    {40, 0.20F},        // asphalt
    {60, 0.60F},        // lane_marking
    {44, 0.26F},        // parking_bay
    {48, 0.36F},        // pavement
    {48, 0.42F},        // kerb
    {72, 0.48F},        // grass
    {50, 0.60F},        // plaster
    {50, 0.35F},        // brick
    {50, 0.09F, 0.4F},  // window
    {50, 0.30F},        // roof
    {51, 0.40F},        // fence_wood
    {51, 0.30F},        // fence_metal
    {51, 0.50F},        // garden_wall
    {70, 0.45F},        // leaves
    {70, 0.40F},        // hedge
    {71, 0.30F},        // bark
    {80, 0.40F},        // pole
    {81, 2.00F},        // sign_face
    {81, 0.35F},        // sign_back
    {49, 0.30F},        // gravel
    {51, 0.30F},        // fence_mesh
    {99, 0.40F},        // street_object
    {52, 0.40F},        // other_structure
    {0, 0.50F},         // paint
    {0, 0.07F, 0.6F},   // glass
    {0, 0.10F},         // tyre
    {0, 1.60F},         // licence_plate
    {0, 0.35F},         // cloth
    {0, 0.55F},         // skin
}};

}  // namespace

float Materials::patch(const Eigen::Vector3f& spot_map) const {
  if (patchiness == 0.0) return 1.0F;
  const double mixed = 0.6 * shade(spot_map, patch_m) + 0.4 * shade(spot_map, 0.1 * patch_m);
  return static_cast<float>(1.0 + patchiness * (2.0 * mixed - 1.0));
}

SurfaceProperties Materials::at(Surface surface, const Eigen::Vector3f& spot_map) const {
  SurfaceProperties properties = of(surface);
  if (!lost_in_panes || properties.lost == 0.0F) return properties;
  constexpr double pane_m = 0.6;
  properties.lost = shade(spot_map, pane_m) < properties.lost ? 0.93F : 0.07F;
  return properties;
}

Materials default_materials() {
  Materials materials;
  for (std::size_t i = 0; i < surface_count; ++i) {
    materials.properties[i] = properties_of(static_cast<Surface>(i));
  }
  return materials;
}

Materials random_materials(Random random) {
  Materials materials = default_materials();
  for (std::size_t i = 0; i < surface_count; ++i) {
    // Asphalt is darker than slabs, and slabs than grass, nearly everywhere.
    const bool is_ground = i <= static_cast<std::size_t>(Surface::grass);
    const double spread = is_ground ? 0.3 : 0.6;
    materials.properties[i].reflectivity *=
        static_cast<float>(std::exp(random.uniform(-spread, spread)));
  }
  // Signs are rarely seen head on, clean and new.
  materials.properties[static_cast<std::size_t>(Surface::sign_face)].reflectivity *=
      random.between(0.15, 1.0);
  // Bays often share the road's asphalt.
  if (random.chance(0.5)) {
    materials.properties[static_cast<std::size_t>(Surface::parking_bay)].reflectivity =
        materials.of(Surface::asphalt).reflectivity;
  }
  // So do sidewalks of asphalt.
  if (random.chance(0.1)) {
    materials.properties[static_cast<std::size_t>(Surface::pavement)].reflectivity =
        materials.of(Surface::asphalt).reflectivity * random.between(0.9, 1.3);
  }
  draw_pile(materials, Surface::grass, 0.0, 0.09, random);
  draw_pile(materials, Surface::leaves, 0.0, 0.25, random);
  draw_pile(materials, Surface::hedge, 0.0, 0.3, random);
  draw_pile(materials, Surface::gravel, 0.0, 0.03, random);
  draw_pile(materials, Surface::cloth, 0.0, 0.03, random);
  draw_pile(materials, Surface::bark, 0.0, 0.04, random);
  draw_lost(materials, Surface::window, 0.1, 0.9, random);
  draw_lost(materials, Surface::glass, 0.3, 0.95, random);
  draw_lost(materials, Surface::tyre, 0.0, 0.5, random);
  draw_lost(materials, Surface::fence_mesh, 0.0, 0.4, random);
  draw_gloss(materials, Surface::paint, 16.0, random);
  draw_gloss(materials, Surface::glass, 5.0, random);
  for (const Surface metal : {Surface::pole, Surface::fence_metal, Surface::sign_back})
    draw_gloss(materials, metal, 4.0, random);
  if (random.chance(0.15)) wet(materials, random);
  materials.lost_in_panes = true;
  materials.patchiness = random.uniform(0.0, 0.6);
  materials.patch_m = random.uniform(2.0, 12.0);
  return materials;
}

SurfaceProperties properties_of(Surface surface) {
  return table[static_cast<std::size_t>(surface)];
}

}  // namespace stillmap::simulation
