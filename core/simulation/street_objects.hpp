#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

// All stand on the origin; x is the direction in which they face the road.

/// A lamp post of any kind: 3 to 10 m, straight, with one arm or two, or a lantern.
[[nodiscard]] Mesh make_any_street_light(Random random);
/// A pole 4 to 30 cm thick: bollard, mast, stump.
[[nodiscard]] Mesh make_any_pole(Random random);
/// One to three plates of any size and shape at 1.8 to 3 m, facing +y; or a board on two posts.
[[nodiscard]] Mesh make_any_sign(Random random);
/// A bin, junction box, bench, advertising column or pile of bags: no class of the networks.
[[nodiscard]] Mesh make_street_object(Random random);
/// A bus shelter, open to the road: neither.
[[nodiscard]] Mesh make_shelter(Random random);

}  // namespace stillmap::simulation
