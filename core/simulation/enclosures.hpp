#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// One field of a fence or wall of any kind, from the origin along x: wire mesh, planks upright or
/// across, railing, posts with rails, boards without gaps; stone walls low and high, with piers or
/// a railing on top.
[[nodiscard]] Mesh make_any_fence(float length_m, Random random);
[[nodiscard]] Mesh make_any_wall(float length_m, Random random);

}  // namespace stillmap::simulation
