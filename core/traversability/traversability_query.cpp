#include "core/traversability/traversability_query.hpp"

#include <sstream>

namespace stillmap {
namespace {

TraversabilityAnswer refused(const TraversabilityView& view, const std::string& reason) {
  TraversabilityAnswer answer;
  answer.grid.status = TraversabilityStatus::invalid_request;
  answer.grid.reason = reason;
  answer.grid.map_version = view.version;
  answer.map_id = view.map_id;
  return answer;
}

std::string faults_of(const TraversabilityQuery& query) {
  if (std::string faults = region_faults(query.region); !faults.empty()) return faults;
  if (!query.include_grid && !query.include_outlines)
    return "nothing wanted: neither grid nor outlines";
  if (query.max_cells == 0) return "max_cells is 0; must be above";
  // Written so that NaN fails.
  if (query.min_outline_area_m2 >= 0.0) return {};
  std::ostringstream text;
  text << "min_outline_area_m2 is " << query.min_outline_area_m2 << "; must be 0 or above";
  return text.str();
}

TraversabilityCellInfo cell_of(const CellLookup::Found& found) {
  TraversabilityCellInfo cell{
      .state = found.cell.state, .reason = found.cell.reason, .inferred = found.cell.inferred};
  if (found.surface != nullptr && found.surface->ground.is_known()) {
    cell.ground_z_m = found.surface->ground.height_m;
  }
  return cell;
}

std::vector<TraversabilityCellInfo> cells_of(const TraversabilityView& view,
                                             const TraversabilityRegion& region,
                                             const OccupancyGrid& grid) {
  std::vector<TraversabilityCellInfo> cells(grid.data.size());
  CellLookup lookup(view);
  visit_cells(view, region, range_of(grid),
              [&](std::size_t i, CellIndex cell) { cells[i] = cell_of(lookup.at(cell)); });
  return cells;
}

}  // namespace

TraversabilityAnswer query_traversability(const TraversabilityView& view,
                                          const TraversabilityQuery& query) {
  if (const std::string faults = faults_of(query); !faults.empty()) return refused(view, faults);
  const TraversabilityRegion region = traversability_region(query.region);
  TraversabilityAnswer answer;
  answer.grid = occupancy_grid(view, region, query.max_cells);
  answer.grid.map_version = view.version;
  answer.map_id = view.map_id;
  if (answer.grid.status != TraversabilityStatus::ok) return answer;
  if (query.include_outlines) {
    answer.outlines = free_outlines(answer.grid, query.min_outline_area_m2);
  }
  if (query.include_grid) {
    answer.cells = cells_of(view, region, answer.grid);
  } else {
    answer.grid.data.clear();
  }
  return answer;
}

}  // namespace stillmap
