#pragma once

#include "core/traversability/cell_grid.hpp"
#include "core/traversability/column_tile.hpp"

namespace stillmap {

/// Source of a cell's ground height.
enum class GroundOrigin : std::uint8_t {
  none,
  /// Measured.
  seen,
  /// Not measured; interpolated from measured ground around it (fill_holes).
  inferred,
  /// Unknown; the height only serves as reference for the heights of objects in the cell.
  assumed,
  /// Unknown, for the cell was measured far below the ground beside it: the bottom of a pit or
  /// ditch. The height is that of its edge.
  pit,
};

/// The ground in a cell.
struct GroundCell {
  /// Map frame [m]; 0 when `origin` is none.
  float height_m = 0.0F;
  /// Highest voxel that belongs to the ground; voxels above it are objects.
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

/// Coarse ground level, from low percentiles of the columns around, interpolated between blocks of
/// them. `cell_m` is the edge of a cell.
class GroundLevel {
 public:
  GroundLevel(const ColumnGrid& columns, double cell_m);
  /// Map frame [m]; NaN without columns near.
  [[nodiscard]] float at(int x, int y) const;

 private:
  int cells_per_block_;
  CellGrid<float> blocks_m_;
};

/// Estimates the ground where it was measured. Voxels of ground classes take precedence: the lowest
/// of a column within a band around the level, and those directly above it. Unlabelled columns: the
/// lowest voxel, if nothing stands up from it as a wall does, and if it is near the level or goes
/// on from ground beside it as a ramp does. Cells far off the median of their neighbours
/// (reflections, a car's roof labelled as road) are rejected. One layer only: below a bridge, the
/// ground is the lower surface. `cell_m` is the edge of a cell.
[[nodiscard]] GroundGrid seen_ground(const ColumnGrid& columns, const GroundLevel& level,
                                     double cell_m);

/// Longest gap that is filled: a parked car with the gaps in front of and behind it [m].
inline constexpr double max_filled_gap_m = 6.0;

/// Interpolates ground in cells without measured ground, such as gaps between the lidar's rings and
/// the footprints of vehicles removed from the map. A cell is filled if a straight line through it
/// (along an axis or a diagonal) meets measured ground at both ends,
///   - over a gap of at most `max_filled_gap_m`,
///   - with no object on the ground in the gap, and no pit: two cells side by side that were
///     measured farther down, in the gap, beside it or below the ground at its ends,
///   - of the same class at both ends (road, parking and other-ground count as one),
///   - and the far end lies on the extrapolated slopes of both ends: no step in between;
/// over more than `max_bare_gap_m`, ground in a third direction, near and of that class, must lie
/// on the same surface. Between ends from which on the ground was measured densely, a gap of more
/// than 0.9 m is no distance of rings: there only a hole is filled, one that is no longer than 8 m
/// along any line through it, from what lies within 0.5 m of its level (on the slope around it) to
/// the next, and not a strip, which may be water that sends nothing back. Where lines
/// disagree about the height, the cell stays unfilled. Other cells with voxels but without ground
/// get an `assumed` level. They are a `pit` if they and two cells beside them were measured below
/// the ground at both ends of a line through them (at its one end, where the other has none), of
/// the nearer one farther than a slope falls, and nothing of theirs at its level. Cells within
/// `border` of the grid's edge are not filled; those with voxels are `assumed`.
/// @pre `seen` has no origin other than `none` and `seen`
[[nodiscard]] GroundGrid fill_holes(const GroundGrid& seen, const ColumnGrid& columns,
                                    const GroundLevel& level, double cell_m, int border = 0);

}  // namespace stillmap
