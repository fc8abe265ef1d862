#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// A tree on the origin: trunk and limbs, and a crown of single leaf bundles with holes between
/// them that rays pass.
[[nodiscard]] Mesh make_tree(Random random);

/// A bush on the origin, about `size_m` wide.
[[nodiscard]] Mesh make_bush(float size_m, Random random);

/// A piece of hedge from the origin along x, `length_m` long, as wide as it is deep.
[[nodiscard]] Mesh make_hedge(float length_m, float height_m, float depth_m, Random random);

/// A tree of any kind: broad or slender, conifer, bare or with branches down to the ground, 3 to
/// 15 m high, upright or leaning.
[[nodiscard]] Mesh make_any_tree(Random random);

/// A bush of any kind, 0.5 to 3.5 m wide: dense, loose, or of several tufts.
[[nodiscard]] Mesh make_any_bush(Random random);

/// A hedge as it grows, from the origin along x: uneven in height and depth.
[[nodiscard]] Mesh make_any_hedge(float length_m, Random random);

}  // namespace stillmap::simulation
