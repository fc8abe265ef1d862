#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// Bodies on the ground, centred on the origin, front along +x.
/// Saloon, estate, hatchback, small car, off-roader or van, no two of the same measures.
[[nodiscard]] Mesh make_car(Random& random);
[[nodiscard]] Mesh make_lorry(Random& random);
[[nodiscard]] Mesh make_city_bus();
/// Lorry, tanker, box van, tipper or pick-up.
[[nodiscard]] Mesh make_truck(Random& random);
/// Bus, minibus or a section of a tram.
[[nodiscard]] Mesh make_bus(Random& random);
/// Caravan, trailer, tractor or digger.
[[nodiscard]] Mesh make_other_vehicle(Random& random);

}  // namespace stillmap::simulation
