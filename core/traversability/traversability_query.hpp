#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/map/query/region.hpp"
#include "core/traversability/occupancy_grid.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Request for the traversability of a region.
struct TraversabilityQuery {
  /// Name of the robot profile, for a server that keeps several.
  std::string profile;
  /// In plan view: heights are ignored, a sphere becomes a circle.
  Region region = BoxRegion{};
  bool include_grid = true;
  bool include_outlines = false;
  /// Largest grid [cells], also if only outlines are requested.
  std::uint64_t max_cells = max_grid_cells;
  /// Smaller free areas get no outline [m^2].
  double min_outline_area_m2 = 1.0;
};

/// Details of a cell beside its value in the grid.
struct TraversabilityCellInfo {
  CellState state = CellState::unknown;
  BlockReason reason = BlockReason::none;
  bool inferred = false;
  /// Height of the ground, map frame [m]; NaN where unknown.
  float ground_z_m = std::numeric_limits<float>::quiet_NaN();
};

struct TraversabilityAnswer {
  /// Its status and reason are those of the answer. Without values if only outlines were requested.
  OccupancyGrid grid;
  /// Id of the map.
  std::uint64_t map_id = 0;
  /// One for each value of the grid.
  std::vector<TraversabilityCellInfo> cells;
  std::vector<TraversablePolygon> outlines;
};

/// Answers `query` for the view's profile, whichever `query` names. A region with faults is an
/// invalid request.
[[nodiscard]] TraversabilityAnswer query_traversability(const TraversabilityView& view,
                                                        const TraversabilityQuery& query);

/// Number of cells in each state.
struct TraversabilitySummary {
  std::uint64_t free = 0;
  /// Part of `free` on inferred ground.
  std::uint64_t inferred = 0;
  /// Unknown cells of the tiles, or of the region that was asked for.
  std::uint64_t unknown = 0;
  /// Indexed by `BlockReason`.
  std::array<std::uint64_t, block_reason_count> lethal{};

  [[nodiscard]] std::uint64_t all_lethal() const;
};

[[nodiscard]] TraversabilitySummary summarize(const TraversabilityView& view);
/// Of an answer with a grid, to a query of this region: its grid is the rectangle about it. Throws
/// std::invalid_argument for a region with faults.
[[nodiscard]] TraversabilitySummary summarize(const TraversabilityAnswer& answer,
                                              const Region& region);

/// Converts an answer to a view, for pictures and further queries. Of the surface, it has the
/// height of known ground only; clearances are 0. @pre the answer's status is ok and it has a grid
[[nodiscard]] TraversabilityView view_of_answer(const TraversabilityAnswer& answer,
                                                const RobotProfile& profile);

}  // namespace stillmap
