#include "core/simulation/garden_shapes.hpp"

#include "core/simulation/enclosures.hpp"
#include "core/simulation/street_furniture.hpp"
#include "core/simulation/vegetation.hpp"

namespace stillmap::simulation {
namespace {

constexpr auto field_m = static_cast<float>(enclosure_field_m);

template <class Make>
ShapeRange add(City& city, std::size_t count, Make make) {
  const ShapeRange range{city.shapes.size(), count};
  for (std::size_t i = 0; i < count; ++i) city.shapes.push_back(make());
  return range;
}

}  // namespace

GardenShapes add_garden_shapes(City& city, bool many, Random& random) {
  const auto fork = [&] { return Random(random.index(1U << 30U)); };
  GardenShapes shapes;
  if (many) {
    shapes.trees = add(city, 10, [&] { return make_any_tree(fork()); });
    shapes.bushes = add(city, 6, [&] { return make_any_bush(fork()); });
    shapes.hedges = add(city, 4, [&] { return make_any_hedge(field_m, fork()); });
    shapes.fences = add(city, 6, [&] { return make_any_fence(field_m, fork()); });
    shapes.walls = add(city, 3, [&] { return make_any_wall(field_m, fork()); });
    return shapes;
  }
  shapes.trees = add(city, 8, [&] { return make_tree(fork()); });
  shapes.bushes =
      add(city, 4, [&] { return make_bush(static_cast<float>(random.uniform(0.7, 1.6)), fork()); });
  shapes.hedges = add(city, 3, [&] {
    return make_hedge(field_m, static_cast<float>(random.uniform(0.9, 1.7)), 0.7F, fork());
  });
  shapes.fences = {city.shapes.size(), 2};
  city.shapes.push_back(make_railing(field_m));
  city.shapes.push_back(make_wooden_fence(field_m));
  shapes.walls = add(city, 1, [&] { return make_garden_wall(field_m); });
  return shapes;
}

}  // namespace stillmap::simulation
