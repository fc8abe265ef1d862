#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "core/simulation/ground_shape.hpp"
#include "core/simulation/mesh.hpp"
#include "core/simulation/object_shapes.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// A shape somewhere in the city.
struct Body {
  /// Index in `City::shapes`.
  std::size_t shape = 0;
  Eigen::Isometry3d T_map_body = Eigen::Isometry3d::Identity();
  /// Class of the surfaces that have none of their own (SemanticKITTI id).
  std::uint16_t label = 0;
  /// Of objects that can be counted, 1..65535; 0 for plants and houses.
  std::uint16_t instance = 0;
  /// Of this object's paint or clothes, multiplies their reflectivity.
  float brightness = 1.0F;
};

/// Everything that stands still.
struct City {
  /// Ground, houses, fences, poles: one piece, in the map frame.
  Mesh fixed;
  std::vector<Mesh> shapes;
  /// Plants and parked vehicles.
  std::vector<Body> bodies;
  std::uint16_t instances = 0;

  [[nodiscard]] std::uint16_t next_instance();
};

/// The standing city of the plan; the same seed gives the same city.
[[nodiscard]] City build_city(const GroundShape& ground, std::uint64_t seed);

/// Houses, gardens and what encloses them, in the blocks between the streets.
void fill_blocks(City& city, const GroundShape& ground, Random random);
/// Vehicles that stand in bays and on car parks.
void park_vehicles(City& city, const GroundShape& ground, Random random);
/// Trees, lights and signs along the streets.
void furnish_streets(City& city, const GroundShape& ground, Random random);

}  // namespace stillmap::simulation
