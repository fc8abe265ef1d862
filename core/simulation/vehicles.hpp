#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap {

/// Bodies on the ground, centred on the origin, front along +x.
/// Saloon, hatchback, off-roader or delivery van.
[[nodiscard]] Mesh make_car(Random& random);
[[nodiscard]] Mesh make_truck(Random& random);
[[nodiscard]] Mesh make_bus();

}  // namespace stillmap
