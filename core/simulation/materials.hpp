#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "core/simulation/random.hpp"

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

/// How the surfaces of one city send light back.
struct Materials {
  /// In the order of `Surface`.
  std::array<SurfaceProperties, surface_count> properties;
  /// Patches on ground and walls are brighter and darker by up to this share, 0..1.
  double patchiness = 0.0;
  /// Size of the coarse patches; the fine ones are a tenth of it [m].
  double patch_m = 6.0;

  [[nodiscard]] const SurfaceProperties& of(Surface surface) const {
    return properties[static_cast<std::size_t>(surface)];
  }
  /// Beams are lost in whole panes and puddles, not one by one.
  bool lost_in_panes = false;

  /// The properties of a surface at a spot of it, with its share of lost beams there.
  [[nodiscard]] SurfaceProperties at(Surface surface, const Eigen::Vector3f& spot_map) const;
  /// Factor on the reflectivity of whatever stands still at `spot_map`.
  [[nodiscard]] float patch(const Eigen::Vector3f& spot_map) const;
};

/// Every surface as `properties_of` has it, without patches.
[[nodiscard]] Materials default_materials();

/// Every surface brighter or darker than usual by factors that are drawn one by one; plants more or
/// less thick, windows that mirror more or less, roads wet or dry.
[[nodiscard]] Materials random_materials(Random random);

}  // namespace stillmap::simulation
