#include "core/traversability/traversability_map.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/map/voxel_grid.hpp"
#include "core/traversability/column_tile.hpp"

namespace stillmap {
namespace {

/// A rectangle of a tile's cells, both ends included.
struct CellBox {
  int min_x = 0, min_y = 0, max_x = 0, max_y = 0;
};

/// Bounding box of the changed cells of each tile.
using ChangedCells = std::map<TileId, CellBox>;

bool is_same(Column a, Column b) { return std::ranges::equal(a, b); }
bool is_same(const SurfaceTile::View& a, const SurfaceTile::View& b) {
  return *a.cell == *b.cell && std::ranges::equal(a.object_heights_m, b.object_heights_m);
}

template <typename TileT>
std::optional<CellBox> difference(const TileT& before, const TileT& after) {
  std::optional<CellBox> box;
  for (int y = 0; y < after.side; ++y) {
    for (int x = 0; x < after.side; ++x) {
      if (is_same(before.at(x, y), after.at(x, y))) continue;
      if (!box) box = CellBox{x, y, x, y};
      box->min_x = std::min(box->min_x, x);
      box->max_x = std::max(box->max_x, x);
      box->max_y = y;
    }
  }
  return box;
}

/// Adds the bounding box of the cells in which two states of a tile differ to `changes`. Null
/// stands for a missing tile; a tile that appears or disappears has changed as a whole.
template <typename TileT>
void note_change(ChangedCells& changes, TileId id, const TileT* before, const TileT* after) {
  if (before != nullptr && after != nullptr) {
    if (const auto box = difference(*before, *after)) changes[id] = *box;
  } else if (before != nullptr || after != nullptr) {
    const int last = (before != nullptr ? before : after)->side - 1;
    changes[id] = {0, 0, last, last};
  }
}

/// Whether a change in [first, last] influences the neighbour at `offset` (-1, 0, 1).
bool reaches(int first, int last, int offset, int side, int margin) {
  if (offset < 0) return first < margin;
  if (offset > 0) return last >= side - margin;
  return true;
}

/// The tiles with changes in them or within `margin` cells around them. @pre margin <= side
std::set<TileId> affected_tiles(const ChangedCells& changes, int side, int margin) {
  std::set<TileId> affected;
  for (const auto& [id, box] : changes) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (reaches(box.min_x, box.max_x, dx, side, margin) &&
            reaches(box.min_y, box.max_y, dy, side, margin)) {
          affected.insert({id.x + dx, id.y + dy});
        }
      }
    }
  }
  return affected;
}

/// The stages of a tile.
struct TileState {
  /// Identify the map tile that the columns were computed from.
  std::uint64_t revision = 0;
  std::uint64_t content_hash = 0;
  std::shared_ptr<const ColumnTile> columns;
  std::shared_ptr<const SurfaceTile> surface;
  /// One for each profile.
  std::vector<std::shared_ptr<const TraversabilityTile>> classified;
};

using TileStates = std::map<TileId, TileState>;

int checked_side(const MapSnapshot& map) {
  const double side = std::round(map.tile_size_m / map.voxel_size_m);
  if (!(map.voxel_size_m > 0.0) || !(side >= 1.0 && side <= VoxelGrid::max_columns) ||
      std::abs(side * map.voxel_size_m - map.tile_size_m) > 1e-6 * map.tile_size_m) {
    throw std::invalid_argument("a map with tiles of " + std::to_string(map.tile_size_m) +
                                " m and voxels of " + std::to_string(map.voxel_size_m) +
                                " m has no cells; tiles must be 1 to 256 whole voxels");
  }
  return static_cast<int>(side);
}

/// One stage of a tile and its neighbours.
template <typename TileT, typename Member>
TileNeighbourhood<TileT> neighbourhood(const TileStates& states, TileId id, int side,
                                       Member member) {
  TileNeighbourhood<TileT> around;
  around.side = side;
  for (int i = 0; i < 9; ++i) {
    const auto found = states.find({id.x + i % 3 - 1, id.y + i / 3 - 1});
    if (found != states.end()) {
      around.tiles.at(static_cast<std::size_t>(i)) = (found->second.*member).get();
    }
  }
  return around;
}

std::vector<TileId> existing(const std::set<TileId>& ids, const TileStates& states) {
  std::vector<TileId> found;
  for (const TileId& id : ids) {
    if (states.contains(id)) found.push_back(id);
  }
  return found;
}

/// Null where it cannot be read now.
std::shared_ptr<const Tile> with_voxels(const std::shared_ptr<const Tile>& tile,
                                        TileReader* reader) {
  if (reader == nullptr) return tile;
  try {
    return reader->read(tile);
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

int margin_cells(double reach_m, double cell_m, int side) {
  return std::min(side, static_cast<int>(std::ceil(reach_m / cell_m)));
}

}  // namespace

struct TraversabilityMap::State {
  std::vector<RobotProfile> profiles;
  TileStates tiles;
  std::uint64_t version = 0;
  std::uint64_t map_id = 0;
  double tile_size_m = 0.0;
  double cell_m = 0.0;
  int side = 0;
  std::vector<std::shared_ptr<const TraversabilityView>> views;

  void set_map(const MapSnapshot& map);
  [[nodiscard]] ChangedCells update_columns(const MapSnapshot& map, TraversabilityUpdate& report,
                                            const ThrottleCallback& throttle, TileReader* reader);
  [[nodiscard]] std::vector<std::shared_ptr<const Tile>> renewed_tiles(
      const MapSnapshot& map) const;
  void drop_missing(const MapSnapshot& map, ChangedCells& changes);
  [[nodiscard]] ChangedCells update_surfaces(const ChangedCells& columns,
                                             TraversabilityUpdate& report,
                                             const ThrottleCallback& throttle);
  void classify_all(const ChangedCells& surfaces, TraversabilityUpdate& report,
                    const ThrottleCallback& throttle);
  void classify_one(TileState& state, TileId id, std::size_t profile) const;
  void publish();
};

/// Drops all tiles if the map has another id or another size of tiles or voxels.
void TraversabilityMap::State::set_map(const MapSnapshot& map) {
  const int new_side = map.tiles.empty() ? 0 : checked_side(map);
  for (const RobotProfile& profile : profiles) {
    const std::string fault = new_side > 0 ? tile_size_fault(profile, map.tile_size_m) : "";
    if (!fault.empty()) throw std::invalid_argument(fault);
  }
  const bool is_same = map.map_id == map_id && map.tile_size_m == tile_size_m &&
                       map.voxel_size_m == cell_m && new_side == side;
  if (!is_same) tiles.clear();
  side = new_side;
  version = map.version;
  map_id = map.map_id;
  tile_size_m = map.tile_size_m;
  cell_m = map.voxel_size_m;
}

std::vector<std::shared_ptr<const Tile>> TraversabilityMap::State::renewed_tiles(
    const MapSnapshot& map) const {
  std::vector<std::shared_ptr<const Tile>> renewed;
  for (const auto& tile : map.tiles) {
    const auto known = tiles.find(tile->info.id);
    if (known == tiles.end() || known->second.revision != tile->info.revision ||
        known->second.content_hash != tile->info.content_hash) {
      renewed.push_back(tile);
    }
  }
  return renewed;
}

void TraversabilityMap::State::drop_missing(const MapSnapshot& map, ChangedCells& changes) {
  std::set<TileId> present;
  for (const auto& tile : map.tiles) present.insert(tile->info.id);
  std::erase_if(tiles, [&](const auto& entry) {
    if (present.contains(entry.first)) return false;
    note_change<ColumnTile>(changes, entry.first, entry.second.columns.get(), nullptr);
    return true;
  });
}

ChangedCells TraversabilityMap::State::update_columns(const MapSnapshot& map,
                                                      TraversabilityUpdate& report,
                                                      const ThrottleCallback& throttle,
                                                      TileReader* reader) {
  ChangedCells changes;
  drop_missing(map, changes);
  const std::vector<std::shared_ptr<const Tile>> renewed = renewed_tiles(map);
  std::vector<std::shared_ptr<const ColumnTile>> columns(renewed.size());
  tbb::parallel_for(std::size_t{0}, renewed.size(), [&](std::size_t i) {
    if (throttle) throttle();
    if (const auto tile = with_voxels(renewed[i], reader))
      columns[i] = std::make_shared<const ColumnTile>(make_columns(*tile, side));
  });
  for (std::size_t i = 0; i < renewed.size(); ++i) {
    if (columns[i] == nullptr) {
      ++report.unread_tiles;
      continue;
    }
    const TileInfo& info = renewed[i]->info;
    TileState& state = tiles[info.id];
    note_change(changes, info.id, state.columns.get(), columns[i].get());
    state.columns = columns[i];
    state.revision = info.revision;
    state.content_hash = info.content_hash;
  }
  return changes;
}

ChangedCells TraversabilityMap::State::update_surfaces(const ChangedCells& columns,
                                                       TraversabilityUpdate& report,
                                                       const ThrottleCallback& throttle) {
  const int margin = margin_cells(surface_reach_m, cell_m, side);
  const std::vector<TileId> ids = existing(affected_tiles(columns, side, margin), tiles);
  std::vector<std::shared_ptr<const SurfaceTile>> surfaces(ids.size());
  tbb::parallel_for(std::size_t{0}, ids.size(), [&](std::size_t i) {
    if (throttle) throttle();
    const auto around = neighbourhood<ColumnTile>(tiles, ids[i], side, &TileState::columns);
    surfaces[i] = std::make_shared<const SurfaceTile>(make_surface(around, cell_m));
  });
  ChangedCells changes;
  // The lethal cells of a removed tile no longer influence its neighbours.
  for (const auto& [id, box] : columns) {
    if (!tiles.contains(id)) changes[id] = box;
  }
  for (std::size_t i = 0; i < ids.size(); ++i) {
    TileState& state = tiles.at(ids[i]);
    note_change(changes, ids[i], state.surface.get(), surfaces[i].get());
    // An unchanged surface stays the same object, so that unchanged tiles compare equal by pointer.
    if (changes.contains(ids[i])) state.surface = surfaces[i];
  }
  report.surfaces = ids.size();
  return changes;
}

void TraversabilityMap::State::classify_one(TileState& state, TileId id,
                                            std::size_t profile) const {
  const auto around = neighbourhood<SurfaceTile>(tiles, id, side, &TileState::surface);
  TraversabilityTile classified{.id = id,
                                .revision = version,
                                .side = side,
                                .cells = classify_tile(around, profiles[profile], cell_m),
                                .surface = state.surface};
  const auto& before = state.classified[profile];
  if (before && before->cells == classified.cells && before->surface == classified.surface) return;
  state.classified[profile] = std::make_shared<const TraversabilityTile>(std::move(classified));
}

void TraversabilityMap::State::classify_all(const ChangedCells& surfaces,
                                            TraversabilityUpdate& report,
                                            const ThrottleCallback& throttle) {
  for (std::size_t profile = 0; profile < profiles.size(); ++profile) {
    const int margin = margin_cells(clearance_limit_m(profiles[profile]), cell_m, side);
    const std::vector<TileId> ids = existing(affected_tiles(surfaces, side, margin), tiles);
    for (const TileId& id : ids) tiles.at(id).classified.resize(profiles.size());
    tbb::parallel_for(std::size_t{0}, ids.size(), [&](std::size_t i) {
      if (throttle) throttle();
      classify_one(tiles.at(ids[i]), ids[i], profile);
    });
    report.classified += ids.size();
  }
}

void TraversabilityMap::State::publish() {
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    auto view = std::make_shared<TraversabilityView>();
    view->version = version;
    view->map_id = map_id;
    view->tile_size_m = tile_size_m;
    view->cell_m = cell_m;
    view->profile = profiles[i];
    for (const auto& [id, state] : tiles) view->tiles.push_back(state.classified[i]);
    views[i] = std::move(view);
  }
}

std::string tile_size_fault(const RobotProfile& profile, double tile_size_m) {
  if (profile.inscribed_radius_m() <= tile_size_m) return {};
  std::ostringstream fault;
  fault << "robot profile '" << profile.name << "' has an inscribed circle of "
        << profile.inscribed_radius_m()
        << " m, which is more than static_map.tile_size_m = " << tile_size_m
        << ": make a map of larger tiles, or leave the profile out";
  return fault.str();
}

TraversabilityMap::TraversabilityMap(std::vector<RobotProfile> profiles)
    : state_(std::make_unique<State>()) {
  std::set<std::string> names;
  for (const RobotProfile& profile : profiles) {
    const std::string faults = profile.faults();
    if (!faults.empty()) {
      throw std::invalid_argument("robot profile '" + profile.name + "': " + faults);
    }
    if (!names.insert(profile.name).second) {
      throw std::invalid_argument("two robot profiles are called '" + profile.name +
                                  "'; clients ask for them by name");
    }
  }
  state_->views.resize(profiles.size());
  state_->profiles = std::move(profiles);
  state_->publish();
}

TraversabilityMap::~TraversabilityMap() = default;
TraversabilityMap::TraversabilityMap(TraversabilityMap&&) noexcept = default;
TraversabilityMap& TraversabilityMap::operator=(TraversabilityMap&&) noexcept = default;

TraversabilityUpdate TraversabilityMap::update(const MapSnapshot& map,
                                               const ThrottleCallback& throttle,
                                               TileReader* tiles) {
  state_->set_map(map);
  TraversabilityUpdate report;
  if (!map.tiles.empty()) {
    const ChangedCells columns = state_->update_columns(map, report, throttle, tiles);
    report.map_tiles = columns.size();
    const ChangedCells surfaces = state_->update_surfaces(columns, report, throttle);
    state_->classify_all(surfaces, report, throttle);
  }
  state_->publish();
  return report;
}

const std::vector<RobotProfile>& TraversabilityMap::profiles() const { return state_->profiles; }

std::shared_ptr<const TraversabilityView> TraversabilityMap::view(
    const std::string& profile) const {
  for (std::size_t i = 0; i < state_->profiles.size(); ++i) {
    if (state_->profiles[i].name == profile) return state_->views[i];
  }
  return nullptr;
}

}  // namespace stillmap
