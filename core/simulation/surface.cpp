#include "core/simulation/surface.hpp"

#include <array>

namespace stillmap::simulation {
namespace {

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

SurfaceProperties properties_of(Surface surface) {
  return table[static_cast<std::size_t>(surface)];
}

}  // namespace stillmap::simulation
