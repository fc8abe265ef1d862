#pragma once

#include <cstddef>
#include <cstdint>

namespace stillmap::simulation {

/// What a triangle is made of.
enum class Surface : std::uint8_t {
  asphalt,
  lane_marking,
  parking_bay,
  pavement,
  kerb,
  grass,
  plaster,
  brick,
  window,
  roof,
  fence_wood,
  fence_metal,
  garden_wall,
  leaves,
  hedge,
  bark,
  pole,
  sign_face,
  sign_back,
  gravel,
  fence_mesh,
  /// Bins, boxes, benches: a class of their own that the networks do not know.
  street_object,
  /// Stairs, shelters, rails of stairs: neither.
  other_structure,
  // From here on parts of objects: their class is the object's.
  paint,
  glass,
  tyre,
  licence_plate,
  cloth,
  skin,
};

struct SurfaceProperties {
  /// SemanticKITTI id; 0: the class of the object it belongs to.
  std::uint16_t label;
  /// Share of light that comes back at right angles, 0..1; above 1: retroreflective.
  float reflectivity;
  /// Share of beams that never come back: mirrored away or let through.
  float lost = 0.0F;
  /// Of blades, twigs or cloth that stand over the surface and return some beams early [m].
  float pile_m = 0.0F;
};

inline constexpr std::size_t surface_count = static_cast<std::size_t>(Surface::skin) + 1;

[[nodiscard]] SurfaceProperties properties_of(Surface surface);

}  // namespace stillmap::simulation
