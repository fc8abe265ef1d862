#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap {

/// A tree on the origin: trunk and limbs, and a crown of single leaf bundles with holes between
/// them that rays pass.
[[nodiscard]] Mesh make_tree(Random random);

/// A bush on the origin, about `size_m` wide.
[[nodiscard]] Mesh make_bush(float size_m, Random random);

/// A piece of hedge from the origin along x, `length_m` long, as wide as it is deep.
[[nodiscard]] Mesh make_hedge(float length_m, float height_m, float depth_m, Random random);

}  // namespace stillmap
