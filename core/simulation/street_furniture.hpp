#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// All stand on the origin; x is the direction in which they face the road.
[[nodiscard]] Mesh make_street_light();
/// Signal head on a pole, facing +y (against the traffic that comes from there).
[[nodiscard]] Mesh make_traffic_light();
/// Round, square or triangular plate facing +y.
[[nodiscard]] Mesh make_sign(Random random);
/// Litter bin, bollard or junction box, whose class SemanticKITTI calls pole or building.
[[nodiscard]] Mesh make_bollard();

/// One field of a fence from the origin along x.
[[nodiscard]] Mesh make_wooden_fence(float length_m);
[[nodiscard]] Mesh make_railing(float length_m);
[[nodiscard]] Mesh make_garden_wall(float length_m);

}  // namespace stillmap::simulation
