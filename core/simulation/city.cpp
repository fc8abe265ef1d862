#include "core/simulation/city.hpp"

#include <cassert>
#include <limits>

#include "core/simulation/ground_mesh.hpp"

namespace stillmap::simulation {

std::uint16_t City::next_instance() {
  assert(instances < std::numeric_limits<std::uint16_t>::max());
  return ++instances;
}

City build_city(const GroundShape& ground, std::uint64_t seed) {
  City city;
  add_ground(city.fixed, ground);
  add_lane_markings(city.fixed, ground);
  fill_blocks(city, ground, Random(seed, 21));
  park_vehicles(city, ground, Random(seed, 23));
  furnish_streets(city, ground, Random(seed, 22));
  return city;
}

}  // namespace stillmap::simulation
