#pragma once

#include <Eigen/Core>
#include <array>

#include "core/simulation/random.hpp"
#include "core/simulation/surface.hpp"

namespace stillmap {

/// How the surfaces of one city send light back.
struct Materials {
  /// In the order of `Surface`.
  std::array<SurfaceFacts, surface_count> facts;
  /// Patches on ground and walls are brighter and darker by up to this share, 0..1.
  double patchiness = 0.0;
  /// Size of the coarse patches; the fine ones are a tenth of it [m].
  double patch_m = 6.0;

  [[nodiscard]] const SurfaceFacts& of(Surface surface) const {
    return facts[static_cast<std::size_t>(surface)];
  }
  /// Beams are lost in whole panes and puddles, not one by one.
  bool lost_in_panes = false;

  /// The facts of a surface at a spot of it, with its share of lost beams there.
  [[nodiscard]] SurfaceFacts at(Surface surface, const Eigen::Vector3f& spot_map) const;
  /// Factor on the reflectivity of whatever stands still at `spot_map`.
  [[nodiscard]] float patch(const Eigen::Vector3f& spot_map) const;
};

/// Every surface as `facts_of` has it, without patches.
[[nodiscard]] Materials usual_materials();

/// Every surface brighter or darker than usual by factors that are drawn one by one; plants more or
/// less thick, windows that mirror more or less, roads wet or dry.
[[nodiscard]] Materials drawn_materials(Random random);

}  // namespace stillmap
