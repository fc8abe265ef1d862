#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/map/query/region.hpp"
#include "core/traversability/occupancy_grid.hpp"
#include "core/traversability/traversable_outline.hpp"

namespace stillmap {

/// Where can this robot go?
struct TraversabilityQuery {
  /// Name of the robot profile, for a server that keeps several.
  std::string profile;
  /// Seen from above: heights do not count, a sphere is its circle.
  Region region = BoxRegion{};
  bool include_grid = true;
  bool include_outlines = false;
  /// Largest grid [cells], also where only outlines are wanted.
  std::uint64_t max_cells = max_grid_cells;
  /// Smaller pieces of free area are left out of the outlines [m^2].
  double min_outline_area_m2 = 1.0;
};

/// What a planner gets to know of a cell besides its value in the grid.
struct TraversabilityCellInfo {
  CellState state = CellState::unknown;
  BlockReason reason = BlockReason::none;
  bool inferred = false;
  /// Of the ground, map frame [m]; NaN where it is not known.
  float ground_z_m = std::numeric_limits<float>::quiet_NaN();
};

struct TraversabilityAnswer {
  /// Its status and reason are the answer's. Without values where only outlines were wanted.
  OccupancyGrid grid;
  /// Of the map that it shows.
  std::uint64_t map_id = 0;
  /// One for each value of the grid.
  std::vector<TraversabilityCellInfo> cells;
  std::vector<TraversablePolygon> outlines;
};

/// Answers `query` from the view, whatever profile it names. A region with faults is an invalid
/// request.
[[nodiscard]] TraversabilityAnswer query_traversability(const TraversabilityView& view,
                                                        const TraversabilityQuery& query);

}  // namespace stillmap
