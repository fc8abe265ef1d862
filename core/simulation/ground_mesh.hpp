#pragma once

#include "core/simulation/ground_shape.hpp"
#include "core/simulation/mesh.hpp"

namespace stillmap::simulation {

/// Roads, kerbs, sidewalks and grass of the whole city, in the map frame.
void add_ground(Mesh& mesh, const GroundShape& ground);

/// Lane lines, stop lines and zebra crossings along the route, 5 mm above the road.
void add_lane_markings(Mesh& mesh, const GroundShape& ground);

}  // namespace stillmap::simulation
