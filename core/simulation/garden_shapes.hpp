#pragma once

#include "core/simulation/city.hpp"

namespace stillmap::simulation {

/// Shapes of one kind, one after the other in `City::shapes`.
struct ShapeRange {
  std::size_t first = 0, count = 0;

  [[nodiscard]] std::size_t draw(Random& random) const { return first + random.index(count); }
};

/// What gardens are made of.
struct GardenShapes {
  ShapeRange trees, bushes, hedges, fences, walls;
};

/// Length of a piece of hedge, fence or wall [m].
inline constexpr double enclosure_field_m = 3.0;

/// Puts them into the city: few plain ones, or many of any kind.
[[nodiscard]] GardenShapes add_garden_shapes(City& city, bool many, Random& random);

}  // namespace stillmap::simulation
