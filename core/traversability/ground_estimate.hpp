#pragma once

#include "core/traversability/cell_grid.hpp"
#include "core/traversability/column_tile.hpp"

namespace stillmap {

/// How the ground of a cell is known.
enum class GroundOrigin : std::uint8_t {
  none,
  /// The lidar hit it.
  seen,
  /// It was not hit, and follows from what was seen around (fill_holes).
  inferred,
  /// Nobody knows it; this level only tells how high above the ground the things in the cell are.
  assumed,
};

/// The ground in a cell.
struct GroundCell {
  /// Map frame [m]; 0 when `origin` is none.
  float height_m = 0.0F;
  /// The highest voxel that counts as ground: what is above it stands on the ground.
  float top_m = 0.0F;
  GroundOrigin origin = GroundOrigin::none;
  SemanticClass label = SemanticClass::unlabeled;

  [[nodiscard]] bool is_known() const {
    return origin == GroundOrigin::seen || origin == GroundOrigin::inferred;
  }
  friend bool operator==(const GroundCell&, const GroundCell&) = default;
};

using ColumnGrid = CellGrid<Column>;
using GroundGrid = CellGrid<GroundCell>;

/// Coarse level of the ground, from the low parts of the columns around. `cell_m` is the edge of a
/// cell [m].
class GroundLevel {
 public:
  GroundLevel(const ColumnGrid& columns, double cell_m);
  /// Map frame [m]; NaN where nothing is near.
  [[nodiscard]] float at(int x, int y) const;

 private:
  int cells_per_block_;
  CellGrid<float> blocks_m_;
};

/// Finds the ground where it was seen. Voxels of a ground class come first: the lowest of a column
/// that is not far from the level of the surroundings, and those right above it. Without classes,
/// the lowest voxel, if it is near that level. A cell far off the median of its neighbours (a
/// reflection, a car's roof that was taken for road) loses its ground again. One layer only: under
/// a bridge, the ground is what lies below.
[[nodiscard]] GroundGrid seen_ground(const ColumnGrid& columns, const GroundLevel& level);

/// Holes are filled over no more than this: a parked car with the gap before and behind it [m].
inline constexpr double max_filled_gap_m = 6.0;

/// Gives ground to cells where none was seen and the surroundings justify it: gaps between the
/// lidar's rings, and the places of vehicles that were taken out of the map. The rule: a straight
/// line through the cell (along an axis or a diagonal) meets seen ground at both ends,
///   - over a gap of at most `max_filled_gap_m`,
///   - with nothing that stands on the ground in the gap,
///   - of the same class at both ends (road, parking and other-ground count as one),
///   - and the far end lies where the slopes at both ends lead to: there is no step in between;
/// over more than `max_bare_gap_m`, ground in a third direction, near and of that class, must lie
/// on the same surface. Lines that disagree about the height leave the hole. Other cells with
/// voxels but without ground get an `assumed` level. `seen` has seen ground only. Cells nearer to
/// the grid's edge than `border` are left as they are.
[[nodiscard]] GroundGrid fill_holes(const GroundGrid& seen, const ColumnGrid& columns,
                                    const GroundLevel& level, double cell_m, int border = 0);

}  // namespace stillmap
