#pragma once

#include <Eigen/Core>
#include <array>

#include "core/simulation/random.hpp"
#include "core/simulation/surface.hpp"

namespace stillmap::simulation {

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
