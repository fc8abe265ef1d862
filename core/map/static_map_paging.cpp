// What of the static map is in memory, and what is stored.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/map/static_map_state.hpp"
#include "core/map/tile_lookup.hpp"
#include "core/map/tile_store.hpp"

namespace stillmap {
namespace {

/// A tile without its voxels weighs this in views and indices.
constexpr std::size_t shelved_tile_bytes = sizeof(Tile) + 64;

bool is_same_size(double a_m, double b_m) { return std::abs(a_m - b_m) <= 1e-9; }

void check_sizes(const MapView& view, const StaticMapConfig& config) {
  if (view.tiles.empty() || (is_same_size(view.voxel_size_m, config.voxel_size_m) &&
                             is_same_size(view.tile_size_m, config.tile_size_m))) {
    return;
  }
  std::ostringstream fault;
  fault << "the stored map has voxel_size_m " << view.voxel_size_m << " and tile_size_m "
        << view.tile_size_m << ", the configuration has " << config.voxel_size_m << " and "
        << config.tile_size_m << ": configure the stored sizes, or start a new map";
  throw std::invalid_argument(fault.str());
}

}  // namespace

bool StaticMap::State::take_back(TileId id) {
  if (shelf == nullptr || unreadable.contains(id)) return false;
  try {
    Resident resident{std::make_unique<LiveTile>(id, shelf->take(id), grid), stored_step};
    tiles.emplace(id, std::move(resident));
  } catch (const std::runtime_error& fault) {
    // What is seen there from now on is not mapped: it would take the place of what is stored.
    unreadable.emplace(id, fault.what());
    return false;
  }
  away.erase(id);
  moved = true;
  return true;
}

std::size_t StaticMap::State::memory_bytes() const {
  std::size_t bytes = away.size() * shelved_tile_bytes;
  for (const auto& [id, resident] : tiles) bytes += resident.live->memory_bytes();
  return bytes;
}

void StaticMap::use_shelf(std::shared_ptr<TileShelf> shelf) { state_->shelf = std::move(shelf); }

MapCheckpoint StaticMap::checkpoint(bool everything) {
  std::vector<LiveTile*> changed;
  for (const auto& [id, resident] : state_->tiles) {
    if (everything || resident.changed_at > state_->stored_step) {
      changed.push_back(resident.live.get());
    }
  }
  // What is stored is what is shown: also where only other rules, or the rounding of a mean on its
  // way through the file, changed it.
  state_->touched.insert(state_->touched.end(), changed.begin(), changed.end());
  MapCheckpoint checkpoint{view(), state_->step++, {}};
  std::vector<TileRecord> records(changed.size());
  tbb::parallel_for(std::size_t{0}, changed.size(), [&](std::size_t i) {
    records[i] = changed[i]->record(state_->rule(), state_->grid);
  });
  for (std::size_t i = 0; i < changed.size(); ++i) {
    checkpoint.records.emplace(changed[i]->id(), std::move(records[i]));
  }
  return checkpoint;
}

void StaticMap::checkpoint_stored(std::uint64_t step) {
  state_->stored_step = std::max(state_->stored_step, step);
}

MemoryUse StaticMap::memory_use() const {
  return {state_->memory_bytes(), state_->tiles.size(), state_->away.size()};
}

std::size_t StaticMap::shelve(const Eigen::Vector3d& position_map, std::size_t limit_bytes) {
  std::size_t bytes = state_->memory_bytes();
  // Before it is reached: the map goes on growing until the next checkpoint.
  if (state_->shelf == nullptr || bytes <= limit_bytes - limit_bytes / 8) return 0;
  // Farther than scans reach, and than a turn would bring back at once.
  const double near_m = state_->config.max_range_m + 2.0 * state_->config.tile_size_m;
  std::vector<std::pair<double, TileId>> candidates;
  for (const auto& [id, resident] : state_->tiles) {
    const double distance_m = state_->distance_m(id, position_map.head<2>());
    if (resident.changed_at <= state_->stored_step && distance_m > near_m) {
      candidates.emplace_back(distance_m, id);
    }
  }
  std::ranges::sort(candidates, std::greater<>());
  // Some more than needed, so that not every scan has to shelve a tile.
  const std::size_t wanted_bytes = limit_bytes - limit_bytes / 4;
  std::size_t shelved_tiles = 0;
  for (const auto& [distance_m, id] : candidates) {
    if (bytes <= wanted_bytes) break;
    const auto resident = state_->tiles.find(id);
    const LiveTile& live = *resident->second.live;
    bytes -= std::min(bytes, live.memory_bytes());
    state_->away.emplace(id, live.published() ? shelved(*live.published()) : nullptr);
    std::erase(state_->touched, &live);
    state_->tiles.erase(resident);
    ++shelved_tiles;
  }
  state_->moved |= shelved_tiles > 0;
  return shelved_tiles;
}

std::vector<std::string> StaticMap::unreadable_tiles() const {
  std::vector<std::string> faults;
  for (const auto& [id, fault] : state_->unreadable) {
    faults.push_back("tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) + "): " + fault);
  }
  return faults;
}

std::vector<RemovedVoxel> StaticMap::removed(const Eigen::AlignedBox3d& box_map) const {
  std::vector<RemovedVoxel> all;
  const auto add = [&](const std::vector<RemovedVoxel>& removed) {
    std::ranges::copy_if(removed, std::back_inserter(all), [&](const RemovedVoxel& voxel) {
      return box_map.contains(voxel.position_map.cast<double>());
    });
  };
  const auto meets = [&](TileId id) {
    return box_map.intersects(tile_footprint(id, state_->grid.tile_size_m()));
  };
  for (const auto& [id, resident] : state_->tiles) {
    if (meets(id)) add(resident.live->removed(state_->rule(), state_->grid));
  }
  for (const auto& [id, shown] : state_->away) {
    if (!meets(id) || state_->shelf == nullptr) continue;
    const TileRecord record = state_->shelf->take(id);
    if (record.memory == nullptr) continue;
    add(removed_voxels(*record.memory, state_->grid.voxel_size_m(), state_->grid.tile_size_m()));
  }
  return all;
}

std::size_t StaticMap::restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
  const auto meets = [&](TileId id) {
    return box_map.intersects(tile_footprint(id, state_->grid.tile_size_m()));
  };
  std::vector<TileId> wanted;
  for (const auto& [id, shown] : state_->away) {
    if (meets(id)) wanted.push_back(id);
  }
  for (const TileId id : wanted) state_->take_back(id);
  ++state_->step;
  std::size_t restored = 0;
  for (auto tile = state_->tiles.begin(); tile != state_->tiles.end(); ++tile) {
    LiveTile& live = *tile.value().live;
    if (!meets(live.id())) continue;
    restored += live.restore(reason, box_map, state_->rule(), state_->grid);
    state_->touched.push_back(&live);
    tile.value().changed_at = state_->step;
  }
  return restored;
}

void StaticMap::restore(const MapView& view, const TileMemories& memories) {
  check_sizes(view, state_->config);
  state_->clear(view.map_id);
  if (view.tiles.empty() && memories.empty()) return;
  for (const auto& tile : view.tiles) {
    const TileId id = tile->info.id;
    if (is_away(*tile)) {
      state_->away.emplace(id, tile);
      continue;
    }
    const auto memory = memories.find(id);
    const TileRecord record{tile, memory == memories.end() ? nullptr : memory->second};
    state_->tiles.emplace(id, State::Resident{std::make_unique<LiveTile>(id, record, state_->grid),
                                              state_->stored_step});
  }
  for (const auto& [id, memory] : memories) {
    if (state_->tiles.contains(id) || state_->away.contains(id)) continue;
    if (memory == nullptr) {
      state_->away.emplace(id, nullptr);
      continue;
    }
    const TileRecord hidden_only{nullptr, memory};
    state_->tiles.emplace(id,
                          State::Resident{std::make_unique<LiveTile>(id, hidden_only, state_->grid),
                                          state_->stored_step});
  }
  MapView current = view;
  current.voxel_size_m = state_->config.voxel_size_m;
  current.tile_size_m = state_->config.tile_size_m;
  state_->current = std::make_shared<const MapView>(std::move(current));
}

void StaticMap::take_back_near(const Eigen::Vector3d& position_map, std::size_t limit_bytes) {
  std::vector<std::pair<double, TileId>> nearest;
  for (const auto& [id, shown] : state_->away) {
    nearest.emplace_back(state_->distance_m(id, position_map.head<2>()), id);
  }
  std::ranges::sort(nearest);
  std::size_t bytes = state_->memory_bytes();
  for (const auto& [distance_m, id] : nearest) {
    if (bytes >= limit_bytes - limit_bytes / 4) return;
    if (state_->take_back(id)) bytes += state_->tiles.find(id)->second.live->memory_bytes();
  }
}

}  // namespace stillmap
