#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// Material of a triangle.
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
  /// Bins, boxes, benches: SemanticKITTI other-object, which no network is trained on.
  street_object,
  /// Stairs, shelters, handrails: SemanticKITTI other-structure, likewise.
  other_structure,
  // Parts of objects: the class is the object's.
  paint,
  glass,
  tyre,
  licence_plate,
  cloth,
  skin,
};

struct SurfaceProperties {
  /// SemanticKITTI id; 0: that of the object it belongs to.
  std::uint16_t label;
  /// At normal incidence, 0..1; above 1: retroreflective.
  float reflectivity;
  /// Share of beams without a return: mirrored away or let through.
  float lost = 0.0F;
  /// Depth of blades, twigs or cloth over the surface that return some beams early [m].
  float pile_m = 0.0F;
  /// Intensity falls by this power of the cosine of incidence beyond that of rough surfaces: what
  /// is smooth mirrors most of the light away.
  float gloss = 0.0F;
};

inline constexpr std::size_t surface_count = static_cast<std::size_t>(Surface::skin) + 1;

[[nodiscard]] SurfaceProperties properties_of(Surface surface);

/// Reflection properties of the surfaces of one city.
struct Materials {
  /// In the order of `Surface`.
  std::array<SurfaceProperties, surface_count> properties;
  /// Amplitude of brightness patches on ground and walls, as a share, 0..1.
  double patchiness = 0.0;
  /// Size of the coarse patches; the fine ones are a tenth of it [m].
  double patch_m = 6.0;

  [[nodiscard]] const SurfaceProperties& of(Surface surface) const {
    return properties[static_cast<std::size_t>(surface)];
  }
  /// Beams are lost in whole panes and puddles instead of independently.
  bool lost_in_panes = false;

  /// Properties at a spot of a surface, with the share of lost beams there.
  [[nodiscard]] SurfaceProperties at(Surface surface, const Eigen::Vector3f& spot_map) const;
  /// Factor on the reflectivity of static surfaces at `spot_map`.
  [[nodiscard]] float patch(const Eigen::Vector3f& spot_map) const;
};

/// `properties_of` every surface, without patches.
[[nodiscard]] Materials default_materials();

/// Random reflectivity of each surface, density of plants, specular loss of windows, wet or dry
/// roads.
[[nodiscard]] Materials random_materials(Random random);

}  // namespace stillmap::simulation
