#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/traversability/cell_grid.hpp"
#include "core/traversability/column_tile.hpp"
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

/// What a cell is like, whoever wants to drive there.
struct SurfaceCell {
  GroundCell ground;
  /// Of known ground only.
  SurfaceShape shape;

  friend bool operator==(const SurfaceCell&, const SurfaceCell&) = default;
};

/// The ground of a tile and what stands on it; the same for all robots.
struct SurfaceTile {
  /// Cells along a side.
  int side = 0;
  /// Row after row from the lowest y.
  std::vector<SurfaceCell> cells;
  /// Of every cell, where its things begin in `object_heights_m`; one more for the end.
  std::vector<std::uint32_t> begin;
  /// Heights of what is not ground above the ground of its cell, from the lowest up [m].
  std::vector<float> object_heights_m;

  /// A cell with what stands in it.
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

/// Things higher above the ground than this are above every robot [m].
inline constexpr float max_object_height_m = 12.0F;

/// The surface of the middle tile. What is farther from it than its neighbours reach, or than
/// `surface_reach_m`, does not count.
[[nodiscard]] SurfaceTile make_surface(const TileNeighbourhood<ColumnTile>& columns, double cell_m);

inline constexpr double surface_reach_m = 8.0;

}  // namespace stillmap
