#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/traversability/cell_grid.hpp"
#include "core/traversability/column_tile.hpp"
#include "core/traversability/ground_estimate.hpp"

namespace stillmap {

/// Local shape of the ground.
struct SurfaceShape {
  /// Inclination of the plane fitted to the ground within half a metre [rad].
  float slope = 0.0F;
  /// RMS distance of that ground from the plane [m].
  float roughness_m = 0.0F;
  /// Largest step between the cell and its neighbours, less the rise that the slope explains, or to
  /// the ground beyond what is unknown beside it [m].
  float step_m = 0.0F;
  /// Largest drop to the ground beyond what is unknown beside it [m], where a slope that may lead
  /// there was not seen: for robots that may drive over unknown ground.
  float hidden_drop_m = 0.0F;

  friend bool operator==(const SurfaceShape&, const SurfaceShape&) = default;
};

/// Shape of the ground at a cell. The plane is fitted to cells of the same class, so that a kerb
/// beside it is a step and not a slope. A step is the height difference across the cell, from one
/// side to the other (or to the cell itself where a side has no ground), less the rise that goes on
/// from cell to cell on either side. Where ground is unknown beside the cell, the first that is
/// known within `max_filled_gap_m` counts, as high as it lies, if no robot's slope leads there (nor
/// the one before it goes on to there): as a step, or, with less of a slope, as a hidden drop.
/// @pre the cell's ground is known
[[nodiscard]] SurfaceShape shape_at(const GroundGrid& ground, int x, int y, double cell_m);

/// Ground of a cell, independent of the robot.
struct SurfaceCell {
  GroundCell ground;
  /// Set for known ground only; of a pit, the step down from its edge.
  SurfaceShape shape;

  friend bool operator==(const SurfaceCell&, const SurfaceCell&) = default;
};

/// The ground of a tile and the objects on it, independent of the robot.
struct SurfaceTile {
  /// Cells along a side.
  int side = 0;
  /// Row by row from the lowest y.
  std::vector<SurfaceCell> cells;
  /// Index in `object_heights_m` of each cell's first object; one more for the end.
  std::vector<std::uint32_t> begin;
  /// Heights of non-ground voxels above the ground of their cell, ascending within each cell [m].
  std::vector<float> object_heights_m;

  /// A cell with its objects.
  struct View {
    const SurfaceCell* cell = nullptr;
    std::span<const float> object_heights_m;
  };
  [[nodiscard]] View at(int x, int y) const {
    const std::size_t i =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(side) + static_cast<std::size_t>(x);
    return {&cells[i], std::span(object_heights_m).subspan(begin[i], begin[i + 1] - begin[i])};
  }
  friend bool operator==(const SurfaceTile&, const SurfaceTile&) = default;
};

/// Largest distance at which columns influence a surface [m].
inline constexpr double surface_reach_m = 8.0;

/// The surface of the middle tile. Columns farther from it than `surface_reach_m`, or than its
/// neighbours extend, have no influence.
[[nodiscard]] SurfaceTile make_surface(const TileNeighbourhood<ColumnTile>& columns, double cell_m);

}  // namespace stillmap
