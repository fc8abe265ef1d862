#include "core/traversability/traversability_query.hpp"

#include <cassert>
#include <cmath>
#include <map>
#include <numeric>
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

/// `Cell` is that of a tile or of an answer.
template <typename Cell>
void count(const Cell& cell, TraversabilitySummary& summary) {
  switch (cell.state) {
    case CellState::unknown:
      ++summary.unknown;
      break;
    case CellState::free:
      ++summary.free;
      if (cell.inferred) ++summary.inferred;
      break;
    case CellState::lethal:
      ++summary.lethal.at(static_cast<std::size_t>(cell.reason));
      break;
  }
}

// Small, so that the view's tiles extend little beyond the answer's grid.
constexpr int tile_side = 20;

int tile_index(std::int32_t cell) {
  return static_cast<int>(std::floor(static_cast<double>(cell) / tile_side));
}

struct NewTile {
  TraversabilityTile area;
  SurfaceTile surface;
};

NewTile empty_tile(TileId id, std::uint64_t version) {
  constexpr std::size_t cells = static_cast<std::size_t>(tile_side) * tile_side;
  NewTile tile;
  tile.area.id = id;
  tile.area.revision = version;
  tile.area.side = tile_side;
  tile.area.cells.resize(cells);
  tile.surface.side = tile_side;
  tile.surface.cells.resize(cells);
  tile.surface.begin.assign(cells + 1, 0);
  return tile;
}

void put(NewTile& tile, std::size_t i, const TraversabilityCellInfo& cell, std::int8_t value) {
  tile.area.cells[i] = {.state = cell.state,
                        .reason = cell.reason,
                        .inferred = cell.inferred,
                        .cost = static_cast<std::uint8_t>(value < 0 ? 0 : value)};
  if (!std::isfinite(cell.ground_z_m)) return;
  tile.surface.cells[i].ground = {
      .height_m = cell.ground_z_m,
      .top_m = cell.ground_z_m,
      .origin = cell.inferred ? GroundOrigin::inferred : GroundOrigin::seen};
}

std::map<TileId, NewTile> tiles_of(const TraversabilityAnswer& answer) {
  std::map<TileId, NewTile> tiles;
  const CellRange range = range_of(answer.grid);
  for (std::size_t i = 0; i < answer.cells.size(); ++i) {
    const auto x = range.first.x + static_cast<std::int32_t>(i % range.width);
    const auto y = range.first.y + static_cast<std::int32_t>(i / range.width);
    const TileId id{tile_index(x), tile_index(y)};
    auto tile = tiles.find(id);
    if (tile == tiles.end()) {
      tile = tiles.emplace(id, empty_tile(id, answer.grid.map_version)).first;
    }
    const auto index = static_cast<std::size_t>((y - id.y * tile_side) * tile_side) +
                       static_cast<std::size_t>(x - id.x * tile_side);
    put(tile->second, index, answer.cells[i], answer.grid.data[i]);
  }
  return tiles;
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

std::uint64_t TraversabilitySummary::all_lethal() const {
  return std::accumulate(lethal.begin(), lethal.end(), std::uint64_t{0});
}

TraversabilitySummary summarize(const TraversabilityView& view) {
  TraversabilitySummary summary;
  for (const auto& tile : view.tiles) {
    for (const TraversabilityCell& cell : tile->cells) count(cell, summary);
  }
  return summary;
}

TraversabilitySummary summarize(const TraversabilityAnswer& answer, const Region& region) {
  TraversabilitySummary summary;
  TraversabilityView cells;
  cells.cell_m = answer.grid.resolution_m;
  visit_cells(cells, traversability_region(region), range_of(answer.grid),
              [&](std::size_t i, CellIndex) { count(answer.cells.at(i), summary); });
  return summary;
}

TraversabilityView view_of_answer(const TraversabilityAnswer& answer, const RobotProfile& profile) {
  assert(answer.grid.status == TraversabilityStatus::ok &&
         answer.cells.size() == answer.grid.data.size());
  TraversabilityView view;
  view.version = answer.grid.map_version;
  view.map_id = answer.map_id;
  view.cell_m = answer.grid.resolution_m;
  view.tile_size_m = tile_side * view.cell_m;
  view.profile = profile;
  for (auto& [id, tile] : tiles_of(answer)) {
    tile.area.surface = std::make_shared<const SurfaceTile>(std::move(tile.surface));
    view.tiles.push_back(std::make_shared<const TraversabilityTile>(std::move(tile.area)));
  }
  return view;
}

}  // namespace stillmap
