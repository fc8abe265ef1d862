#pragma once

#include <optional>
#include <string>

#include "core/simulation/random.hpp"
#include "core/simulation/surface.hpp"

namespace stillmap::simulation {

/// How a real lidar's returns differ from geometry.
struct BeamNoise {
  double range_sigma_m = 0.02;
  /// Share of beams lost for no visible reason.
  double drop_share = 0.01;
  double intensity_sigma = 0.015;
  /// reflectivity * sqrt(cos incidence) / range^2 at which half of the beams come back [1/m^2].
  double min_return = 1.2e-5;

  /// Every fault in words, one a line.
  [[nodiscard]] std::string faults() const;
};

struct BeamReturn {
  float range_m;
  /// 0..1.
  float intensity;
};

/// What the lidar reports of a surface `range_m` away; nothing when too little light comes back.
/// @param brightness multiplies the surface's reflectivity.
[[nodiscard]] std::optional<BeamReturn> beam_return(const BeamNoise& noise, float range_m,
                                                    float cos_incidence,
                                                    const SurfaceProperties& surface,
                                                    float brightness, Random& random);

}  // namespace stillmap::simulation
