#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// A house: its front looks along -y, its foot is centred on the origin [m].
struct BuildingPlan {
  float width_m, depth_m;
  int floors;
  bool gabled;
  bool balconies;
  Surface wall;
  /// Share of bays that have a window.
  float share_windows = 1.0F;
  /// Porches, bay windows, garages and steps in front.
  bool outbuildings = false;
};

/// Walls with recessed windows, doors, pilasters, sills and balconies; a gabled roof or a flat one
/// with a parapet. Reaches 3 m below the ground, so that it stands on slopes.
[[nodiscard]] Mesh make_building(const BuildingPlan& plan, Random random);

/// What is built onto the front of a house: steps and a porch, a bay window, a garage.
void add_outbuildings(Mesh& house, const BuildingPlan& plan, Random& random);

}  // namespace stillmap::simulation
