#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap {

/// A house: its front looks along -y, its foot is centred on the origin [m].
struct BuildingPlan {
  float width_m, depth_m;
  int floors;
  bool gabled;
  bool balconies;
  Surface wall;
};

/// Walls with recessed windows, doors, pilasters, sills and balconies; a gabled roof or a flat one
/// with a parapet. Reaches 1.5 m below the ground, so that it stands on slopes.
[[nodiscard]] Mesh make_building(const BuildingPlan& plan, Random random);

}  // namespace stillmap
