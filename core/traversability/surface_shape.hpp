#pragma once

#include "core/traversability/ground_estimate.hpp"

namespace stillmap {

/// How the ground lies around a cell.
struct SurfaceShape {
  /// Angle of the plane through the ground within half a metre [rad].
  float slope = 0.0F;
  /// RMS distance of that ground from the plane [m].
  float roughness_m = 0.0F;
  /// Highest edge between the cell and its neighbours, without what the slope explains [m].
  float step_m = 0.0F;

  friend bool operator==(const SurfaceShape&, const SurfaceShape&) = default;
};

/// Reaches of `shape_at`: cells farther away than this do not count.
[[nodiscard]] int shape_reach_cells(double cell_m);

/// Shape of the ground at a cell that has some. The plane is fitted to cells of its own class, so
/// that a kerb beside it is a step and not a slope. A step is the difference across the cell, from
/// one side to the other (or to the cell itself where a side has no ground), less what the ground
/// on either side rises anyway.
[[nodiscard]] SurfaceShape shape_at(const GroundGrid& ground, int x, int y, double cell_m);

}  // namespace stillmap
