#pragma once

#include "core/simulation/mesh.hpp"

namespace stillmap::simulation {

/// Two wheels at `x`, their outer sides `half_width` from the middle [m].
void add_axle(Mesh& mesh, float x, float half_width, float radius);

/// Licence plates at the front and the rear end.
void add_licence_plates(Mesh& mesh, float front, float rear);

}  // namespace stillmap::simulation
