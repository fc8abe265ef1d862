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
constexpr std::size_t non_resident_tile_bytes = sizeof(Tile) + 64;

bool is_same_size(double a_m, double b_m) { return std::abs(a_m - b_m) <= 1e-9; }

void check_sizes(const MapSnapshot& view, const StaticMapConfig& config) {
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

bool StaticMap::State::reload(TileId id) {
  if (tile_store == nullptr || unreadable.contains(id)) return false;
  try {
    Resident resident{std::make_unique<LiveTile>(id, tile_store->load(id), grid), stored_step};
    tiles.emplace(id, std::move(resident));
  } catch (const std::runtime_error& fault) {
    // What is seen there from now on is not mapped: it would take the place of what is stored.
    unreadable.emplace(id, fault.what());
    return false;
  }
  non_resident.erase(id);
  residency_changed = true;
  return true;
}

std::size_t StaticMap::State::memory_bytes() const {
  std::size_t bytes = non_resident.size() * non_resident_tile_bytes;
  for (const auto& [id, resident] : tiles) bytes += resident.live->memory_bytes();
  return bytes;
}

void StaticMap::use_tile_store(std::shared_ptr<TileStore> tile_store) {
  state_->tile_store = std::move(tile_store);
}

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
  return {state_->memory_bytes(), state_->tiles.size(), state_->non_resident.size()};
}

std::size_t StaticMap::evict(const Eigen::Vector3d& position_map, std::size_t limit_bytes) {
  std::size_t bytes = state_->memory_bytes();
  // Before it is reached: the map goes on growing until the next checkpoint.
  if (state_->tile_store == nullptr || bytes <= limit_bytes - limit_bytes / 8) return 0;
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
  // Some more than needed, so that not every scan has to evict a tile.
  const std::size_t wanted_bytes = limit_bytes - limit_bytes / 4;
  std::size_t evicted_tiles = 0;
  for (const auto& [distance_m, id] : candidates) {
    if (bytes <= wanted_bytes) break;
    const auto resident = state_->tiles.find(id);
    const LiveTile& live = *resident->second.live;
    bytes -= std::min(bytes, live.memory_bytes());
    state_->non_resident.emplace(id,
                                 live.published() ? without_voxels(*live.published()) : nullptr);
    std::erase(state_->touched, &live);
    state_->tiles.erase(resident);
    ++evicted_tiles;
  }
  state_->residency_changed |= evicted_tiles > 0;
  return evicted_tiles;
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
  for (const auto& [id, shown] : state_->non_resident) {
    if (!meets(id) || state_->tile_store == nullptr) continue;
    const TileRecord record = state_->tile_store->load(id);
    if (record.evidence == nullptr) continue;
    add(removed_voxels(*record.evidence, state_->grid.voxel_size_m(), state_->grid.tile_size_m()));
  }
  return all;
}

std::size_t StaticMap::restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
  const auto meets = [&](TileId id) {
    return box_map.intersects(tile_footprint(id, state_->grid.tile_size_m()));
  };
  std::vector<TileId> wanted;
  for (const auto& [id, shown] : state_->non_resident) {
    if (meets(id)) wanted.push_back(id);
  }
  for (const TileId id : wanted) state_->reload(id);
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

void StaticMap::resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence) {
  check_sizes(view, state_->config);
  state_->clear(view.map_id);
  if (view.tiles.empty() && tile_evidence.empty()) return;
  for (const auto& tile : view.tiles) {
    const TileId id = tile->info.id;
    if (is_non_resident(*tile)) {
      state_->non_resident.emplace(id, tile);
      continue;
    }
    const auto evidence = tile_evidence.find(id);
    const TileRecord record{tile, evidence == tile_evidence.end() ? nullptr : evidence->second};
    state_->tiles.emplace(id, State::Resident{std::make_unique<LiveTile>(id, record, state_->grid),
                                              state_->stored_step});
  }
  for (const auto& [id, evidence] : tile_evidence) {
    if (state_->tiles.contains(id) || state_->non_resident.contains(id)) continue;
    if (evidence == nullptr) {
      state_->non_resident.emplace(id, nullptr);
      continue;
    }
    const TileRecord hidden_only{nullptr, evidence};
    state_->tiles.emplace(id,
                          State::Resident{std::make_unique<LiveTile>(id, hidden_only, state_->grid),
                                          state_->stored_step});
  }
  MapSnapshot current = view;
  current.voxel_size_m = state_->config.voxel_size_m;
  current.tile_size_m = state_->config.tile_size_m;
  state_->current = std::make_shared<const MapSnapshot>(std::move(current));
}

void StaticMap::reload_near(const Eigen::Vector3d& position_map, std::size_t limit_bytes) {
  std::vector<std::pair<double, TileId>> nearest;
  for (const auto& [id, shown] : state_->non_resident) {
    nearest.emplace_back(state_->distance_m(id, position_map.head<2>()), id);
  }
  std::ranges::sort(nearest);
  std::size_t bytes = state_->memory_bytes();
  for (const auto& [distance_m, id] : nearest) {
    if (bytes >= limit_bytes - limit_bytes / 4) return;
    if (state_->reload(id)) bytes += state_->tiles.find(id)->second.live->memory_bytes();
  }
}

}  // namespace stillmap
