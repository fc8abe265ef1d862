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

/// How much of an area is in which state [cells].
struct TraversabilitySummary {
  std::uint64_t free = 0;
  /// Of the free ones.
  std::uint64_t inferred = 0;
  /// Unknown cells of the tiles, or of an answer's grid; most of them lie behind walls.
  std::uint64_t unknown = 0;
  /// By `BlockReason`.
  std::array<std::uint64_t, block_reason_count> lethal{};

  [[nodiscard]] std::uint64_t all_lethal() const;
};

[[nodiscard]] TraversabilitySummary summarize(const TraversabilityView& view);
/// Of an answer with a grid.
[[nodiscard]] TraversabilitySummary summarize(const TraversabilityAnswer& answer);

/// The cells of an answer as a view, to draw, count or ask further. Of the surface, only the height
/// of known ground is in it; clearances are not (0). @pre the answer's status is ok and it has a
/// grid.
[[nodiscard]] TraversabilityView view_of_answer(const TraversabilityAnswer& answer,
                                                const RobotProfile& profile);

}  // namespace stillmap
