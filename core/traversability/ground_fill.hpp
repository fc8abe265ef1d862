#pragma once

#include "core/traversability/ground_estimate.hpp"

namespace stillmap {

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
