#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// People and two-wheelers on the ground, centred on the origin, front along +x.
[[nodiscard]] Mesh make_person(Random& random);
[[nodiscard]] Mesh make_bicycle(Random& random);
[[nodiscard]] Mesh make_motorcycle(Random& random);
[[nodiscard]] Mesh make_bicyclist(Random& random);
[[nodiscard]] Mesh make_motorcyclist(Random& random);

}  // namespace stillmap::simulation
