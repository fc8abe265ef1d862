#include "core/traversability/traversability_query.hpp"

#include <sstream>

namespace stillmap {
namespace {

AreaAnswer refused(const TraversabilityView& view, const std::string& reason) {
  AreaAnswer answer;
  answer.grid.status = AreaStatus::invalid_request;
  answer.grid.reason = reason;
  answer.grid.map_version = view.version;
  answer.map_id = view.map_id;
  return answer;
}

std::string faults_of(const AreaQuery& query) {
  if (std::string faults = region_faults(query.region); !faults.empty()) return faults;
  if (!query.wants_grid && !query.wants_outlines)
    return "nothing wanted: neither grid nor outlines";
  if (query.max_cells == 0) return "max_cells is 0; must be above";
  // Written so that NaN fails.
  if (query.min_outline_area_m2 >= 0.0) return {};
  std::ostringstream text;
  text << "min_outline_area_m2 is " << query.min_outline_area_m2 << "; must be 0 or above";
  return text.str();
}

AreaCell cell_of(const CellLookup::Found& found) {
  AreaCell cell{
      .state = found.cell.state, .reason = found.cell.reason, .inferred = found.cell.inferred};
  if (found.surface != nullptr && found.surface->ground.is_known()) {
    cell.ground_z_m = found.surface->ground.height_m;
  }
  return cell;
}

std::vector<AreaCell> cells_of(const TraversabilityView& view, const AreaRegion& region,
                               const OccupancyGrid& grid) {
  std::vector<AreaCell> cells(grid.data.size());
  CellLookup lookup(view);
  visit_cells(view, region, range_of(grid),
              [&](std::size_t i, CellIndex cell) { cells[i] = cell_of(lookup.at(cell)); });
  return cells;
}

}  // namespace

AreaAnswer answer_area(const TraversabilityView& view, const AreaQuery& query) {
  if (const std::string faults = faults_of(query); !faults.empty()) return refused(view, faults);
  const AreaRegion region = area_region(query.region);
  AreaAnswer answer;
  answer.grid = occupancy_grid(view, region, query.max_cells);
  answer.grid.map_version = view.version;
  answer.map_id = view.map_id;
  if (answer.grid.status != AreaStatus::ok) return answer;
  if (query.wants_outlines) {
    answer.outlines = free_outlines(answer.grid, query.min_outline_area_m2);
  }
  if (query.wants_grid) {
    answer.cells = cells_of(view, region, answer.grid);
  } else {
    answer.grid.data.clear();
  }
  return answer;
}

}  // namespace stillmap
