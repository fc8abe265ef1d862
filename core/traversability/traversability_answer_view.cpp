#include "core/traversability/traversability_answer_view.hpp"

#include <cassert>
#include <cmath>
#include <map>

namespace stillmap {
namespace {

// Small, so that what is made of the view has hardly more to it than the answer.
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
    const auto place = static_cast<std::size_t>((y - id.y * tile_side) * tile_side) +
                       static_cast<std::size_t>(x - id.x * tile_side);
    put(tile->second, place, answer.cells[i], answer.grid.data[i]);
  }
  return tiles;
}

}  // namespace

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
