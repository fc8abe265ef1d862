#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "core/simulation/ground.hpp"
#include "core/simulation/mesh.hpp"
#include "core/simulation/object_shapes.hpp"
#include "core/simulation/random.hpp"
#include "core/simulation/ray_scene.hpp"

namespace stillmap::simulation {

/// A placed shape.
struct Body {
  /// Index in `City::shapes`.
  std::size_t shape = 0;
  Eigen::Isometry3d T_map_body = Eigen::Isometry3d::Identity();
  /// Class of the surfaces that have none of their own (SemanticKITTI id).
  std::uint16_t label = 0;
  /// 1..65535 for countable objects; 0 for plants and houses.
  std::uint16_t instance = 0;
  /// Factor on the reflectivity of this object's surfaces.
  float brightness = 1.0F;
};

/// Shapes of one kind, one after the other in `City::shapes`.
struct ShapeRange {
  std::size_t first = 0, count = 0;

  [[nodiscard]] std::size_t draw(Random& random) const { return first + random.index(count); }
};

/// Everything that does not move.
struct City {
  /// Ground, houses, fences, poles: one piece, in the map frame.
  Mesh fixed;
  std::vector<Mesh> shapes;
  /// Plants, parked vehicles and standing people.
  std::vector<Body> bodies;
  std::uint16_t instances = 0;

  [[nodiscard]] std::uint16_t next_instance();
  /// Appends `count` shapes; `make` is called for each.
  template <class Make>
  ShapeRange add_shapes(std::size_t count, Make make) {
    const ShapeRange range{shapes.size(), count};
    for (std::size_t i = 0; i < count; ++i) shapes.push_back(make());
    return range;
  }

  /// For a `RayScene`: `fixed`, then `shapes`.
  [[nodiscard]] std::vector<const Mesh*> meshes() const;
  /// For a `RayScene`: `fixed`, then `bodies`, as indices of `meshes()`.
  [[nodiscard]] std::vector<StandingMesh> standing_meshes() const;
};

/// The standing city of the plan; the same seed gives the same city, and the same `day_seed` the
/// same parked vehicles in it.
[[nodiscard]] City build_city(const GroundShape& ground, std::uint64_t seed,
                              std::uint64_t day_seed);

/// Houses, gardens and their enclosures, in the blocks between the streets.
void fill_blocks(City& city, const GroundShape& ground, Random random);
/// Vehicles in bays and on car parks.
void park_vehicles(City& city, const GroundShape& ground, Random random);
/// Trees, lights, signs and standing people along the streets.
void furnish_streets(City& city, const GroundShape& ground, Random random);

}  // namespace stillmap::simulation
