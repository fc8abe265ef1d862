#include "core/map/static_map.hpp"

#include <tbb/parallel_for.h>
#include <tsl/robin_map.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/lidar/voxel_index.hpp"
#include "core/map/live_tile.hpp"
#include "core/map/scan_sorter.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

std::string tile_size_fault(const StaticMapConfig& config) {
  const double columns = config.tile_size_m / config.voxel_size_m;
  // 20.0 / 0.2 is not exactly 100.
  if (columns >= 1.0 - 1e-6 && columns <= VoxelGrid::max_columns + 1e-6 &&
      std::abs(columns - std::round(columns)) < 1e-6 * columns) {
    return {};
  }
  std::ostringstream fault;
  fault << "tile_size_m = " << config.tile_size_m << "; must be 1 to " << VoxelGrid::max_columns
        << " whole voxels of voxel_size_m (" << config.voxel_size_m << ")\n";
  return fault.str();
}

struct TileIdHash {
  std::size_t operator()(const TileId& id) const {
    const auto x = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.x));
    const auto y = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.y));
    return IndexHash{}(x << 32 | y);
  }
};

/// Requires config without faults.
VoxelGrid usable_grid(const StaticMapConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument("static map: " + faults);
  }
  return {config.voxel_size_m, config.tile_size_m};
}

/// Memory of a non-resident tile in snapshots and indices.
constexpr std::size_t non_resident_tile_bytes = sizeof(Tile) + 64;

bool is_same_size(double a_m, double b_m) { return std::abs(a_m - b_m) <= 1e-9; }

}  // namespace

std::string StaticMapConfig::faults() const {
  constexpr double min_voxel_size_m = 0.01;
  constexpr double max_range_tiles = 100.0;
  std::ostringstream faults;
  if (!(voxel_size_m >= min_voxel_size_m && voxel_size_m <= 10.0)) {
    faults << "voxel_size_m = " << voxel_size_m << "; must be 0.01 to 10\n";
  }
  faults << tile_size_fault(*this);
  if (!(max_range_m > 0.0 && max_range_m <= max_range_tiles * tile_size_m)) {
    faults << "max_range_m = " << max_range_m << "; must be above 0 and at most " << max_range_tiles
           << " tiles (" << max_range_tiles * tile_size_m << ")\n";
  }
  if (!(clearing_range_m >= 0.0 && clearing_range_m <= 1000.0)) {
    faults << "clear_range_m = " << clearing_range_m << "; must be 0 (off) to 1000\n";
  }
  if (!(clearing_margin_m >= voxel_size_m && clearing_margin_m <= 100.0)) {
    faults << "clear_margin_m = " << clearing_margin_m << "; must be at least voxel_size_m ("
           << voxel_size_m << ") and at most 100\n";
  }
  if (!(clearing_margin_share >= 0.0 && clearing_margin_share <= 1.0)) {
    faults << "clear_margin_share = " << clearing_margin_share << "; must be 0 to 1\n";
  }
  if (clearing_interval == 0 || clearing_interval > 1000) {
    faults << "clearing_interval = " << clearing_interval << "; must be 1 to 1000\n";
  }
  if (misses_to_clear == 0 || misses_to_clear > 1000)
    faults << "misses_to_clear = " << misses_to_clear << "; must be 1 to 1000\n";
  if (misses_per_hit == 0 || misses_per_hit > 1000) {
    faults << "misses_per_hit = " << misses_per_hit << "; must be 1 to 1000\n";
  }
  if (min_points == 0) faults << "min_points = 0; must be at least 1\n";
  return faults.str();
}

void check_sizes(const MapSnapshot& stored, const StaticMapConfig& config) {
  if (stored.tiles.empty() || (is_same_size(stored.voxel_size_m, config.voxel_size_m) &&
                               is_same_size(stored.tile_size_m, config.tile_size_m))) {
    return;
  }
  std::ostringstream fault;
  fault << "the stored map has voxel_size_m " << stored.voxel_size_m << " and tile_size_m "
        << stored.tile_size_m << ", the configuration has " << config.voxel_size_m << " and "
        << config.tile_size_m << ": configure the stored sizes, or start a new map";
  throw std::invalid_argument(fault.str());
}

struct StaticMap::State {
  /// A tile in memory.
  struct Resident {
    std::unique_ptr<LiveTile> live;
    /// Step of the map in which it last changed.
    std::uint64_t changed_at = 0;
  };

  explicit State(const StaticMapConfig& map_config);

  void clear(std::uint64_t map_id);
  [[nodiscard]] VisibilityRule rule() const {
    return {config.min_points, config.misses_to_clear, config.misses_per_hit};
  }
  /// A new tile, a resident one, or one from the tile store; null when it cannot be read.
  [[nodiscard]] LiveTile* tile(TileId id);
  /// Reads a non-resident tile from the tile store; false when it cannot be read.
  bool reload(TileId id);
  /// The tile changed in this step.
  void touch(LiveTile& live);
  /// Tiles in memory whose footprint comes this near.
  [[nodiscard]] std::vector<LiveTile*> tiles_near(const Eigen::Vector3f& position_map,
                                                  double range_m) const;
  /// From the tile's footprint [m].
  [[nodiscard]] double distance_m(TileId id, const Eigen::Vector2d& position_map) const;
  [[nodiscard]] std::vector<std::shared_ptr<const Tile>> published_tiles() const;
  [[nodiscard]] std::size_t memory_bytes() const;

  StaticMapConfig config;
  VoxelGrid grid;
  ScanSorter sorter;
  tsl::robin_map<TileId, Resident, TileIdHash> tiles;
  /// In the tile store: the tile without its voxels, null where it shows none.
  std::map<TileId, std::shared_ptr<const Tile>> non_resident;
  std::shared_ptr<TileStore> tile_store;
  /// Why tiles that are non-resident could not be read.
  std::map<TileId, std::string> unreadable;
  /// Tiles with points since the last view; a tile may be named more than once.
  std::vector<LiveTile*> touched;
  /// Tiles were evicted or reloaded since the last view.
  bool residency_changed = false;
  bool is_frozen = false;
  /// Scans so far.
  std::uint64_t inserted = 0;
  /// Counts the changes of tiles; up to `stored_step` they are in the tile store.
  std::uint64_t step = 1;
  std::uint64_t stored_step = 0;
  /// The last view.
  std::shared_ptr<const MapSnapshot> current;
};

StaticMap::State::State(const StaticMapConfig& map_config)
    : config(map_config), grid(usable_grid(map_config)), sorter(grid, map_config.max_range_m) {
  clear(0);
}

void StaticMap::State::clear(std::uint64_t map_id) {
  tiles.clear();
  non_resident.clear();
  unreadable.clear();
  touched.clear();
  inserted = 0;
  stored_step = step++;
  MapSnapshot empty;
  empty.map_id = map_id;
  empty.tile_size_m = config.tile_size_m;
  empty.voxel_size_m = config.voxel_size_m;
  current = std::make_shared<const MapSnapshot>(std::move(empty));
}

LiveTile* StaticMap::State::tile(TileId id) {
  if (const auto known = tiles.find(id); known != tiles.end()) return known->second.live.get();
  if (non_resident.contains(id)) {
    return reload(id) ? tiles.find(id)->second.live.get() : nullptr;
  }
  Resident fresh{std::make_unique<LiveTile>(id), step};
  return tiles.emplace(id, std::move(fresh)).first->second.live.get();
}

void StaticMap::State::touch(LiveTile& live) {
  touched.push_back(&live);
  tiles.find(live.id()).value().changed_at = step;
}

double StaticMap::State::distance_m(TileId id, const Eigen::Vector2d& position_map) const {
  const Eigen::Vector2d low = Eigen::Vector2d(id.x, id.y) * grid.tile_size_m();
  const Eigen::AlignedBox2d footprint(low, low.array() + grid.tile_size_m());
  return footprint.exteriorDistance(position_map);
}

std::vector<LiveTile*> StaticMap::State::tiles_near(const Eigen::Vector3f& position_map,
                                                    double range_m) const {
  const Eigen::Vector2d position = position_map.head<2>().cast<double>();
  std::vector<LiveTile*> near;
  for (const auto& [id, resident] : tiles) {
    if (distance_m(id, position) <= range_m) near.push_back(resident.live.get());
  }
  return near;
}

std::vector<std::shared_ptr<const Tile>> StaticMap::State::published_tiles() const {
  std::vector<std::shared_ptr<const Tile>> published;
  published.reserve(tiles.size() + non_resident.size());
  for (const auto& [id, resident] : tiles) {
    if (resident.live->published()) published.push_back(resident.live->published());
  }
  for (const auto& [id, shown] : non_resident) {
    if (shown) published.push_back(shown);
  }
  std::ranges::sort(published, {}, [](const auto& shared) { return shared->info.id; });
  return published;
}

StaticMap::StaticMap(const StaticMapConfig& config) : state_(std::make_unique<State>(config)) {}
StaticMap::~StaticMap() = default;
StaticMap::StaticMap(StaticMap&&) noexcept = default;
StaticMap& StaticMap::operator=(StaticMap&&) noexcept = default;

void StaticMap::insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar) {
  assert(scan.motion.size() == scan.scan.size());
  assert(scan.labels.empty() || scan.labels.classes.size() == scan.scan.size());
  if (state_->is_frozen) return;
  const auto batches = state_->sorter.sort(scan, T_map_lidar);
  std::vector<LiveTile*> hit(batches.size());
  std::ranges::transform(batches, hit.begin(),
                         [&](const auto& batch) { return state_->tile(batch.tile); });
  // A tile belongs to one task, which takes its points in the order of the scan: the map does not
  // depend on how many threads there are.
  tbb::parallel_for(std::size_t{0}, hit.size(), [&](std::size_t i) {
    if (hit[i] != nullptr) hit[i]->insert(batches[i].points, scan.scan.stamp_ns);
  });
  ++state_->step;
  for (LiveTile* const tile : hit) {
    if (tile != nullptr) state_->touch(*tile);
  }
  ++state_->inserted;
}

void StaticMap::set_frozen(bool is_frozen) { state_->is_frozen = is_frozen; }

bool StaticMap::clearing_due() const {
  return !state_->is_frozen && state_->config.clearing_range_m > 0.0 &&
         state_->inserted % state_->config.clearing_interval == 0;
}

void StaticMap::clear_seen_through(const RangeImageView& view, std::int64_t stamp_ns) {
  if (state_->is_frozen) return;
  const StaticMapConfig& config = state_->config;
  const auto is_free = [&](const Eigen::Vector3f& position_map) {
    const double range_m = (position_map - view.origin_map()).norm();
    if (range_m > config.clearing_range_m) return false;
    const auto observation = view.observe(position_map);
    return observation && observation->nearest_m > range_m + config.clearing_margin_m +
                                                       config.clearing_margin_share * range_m;
  };
  const std::vector<LiveTile*> near =
      state_->tiles_near(view.origin_map(), config.clearing_range_m);
  std::vector<std::uint8_t> hides(near.size());
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t i) {
    hides[i] = near[i]->clear_seen_through(is_free, stamp_ns, state_->rule(), state_->grid) ? 1 : 0;
  });
  ++state_->step;
  for (std::size_t i = 0; i < near.size(); ++i) {
    // Counts changed in all of them; only tiles with a voxel to hide are published again.
    state_->tiles.find(near[i]->id()).value().changed_at = state_->step;
    if (hides[i] != 0) state_->touched.push_back(near[i]);
  }
}

ClassEvidence StaticMap::evidence_at(const Eigen::Vector3d& position_map) const {
  if (!state_->grid.holds(position_map)) return {};
  const VoxelGrid::Index index = state_->grid.index(position_map);
  const auto tile = state_->tiles.find(index.tile);
  return tile == state_->tiles.end() ? ClassEvidence()
                                     : tile->second.live->evidence(voxel_key(index.voxel));
}

std::shared_ptr<const MapSnapshot> StaticMap::view() {
  std::vector<LiveTile*> touched = std::exchange(state_->touched, {});
  std::ranges::sort(touched);
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());

  const std::uint64_t version = state_->current->version + 1;
  std::vector<std::uint8_t> changed(touched.size());
  tbb::parallel_for(std::size_t{0}, touched.size(), [&](std::size_t i) {
    changed[i] = touched[i]->publish(version, state_->rule(), state_->grid) ? 1 : 0;
  });
  const bool has_changed = std::ranges::find(changed, 1) != changed.end();
  if (!has_changed && !std::exchange(state_->residency_changed, false)) return state_->current;

  state_->residency_changed = false;
  MapSnapshot next = {has_changed ? version : state_->current->version, state_->current->map_id,
                      state_->config.tile_size_m, state_->config.voxel_size_m,
                      state_->published_tiles()};
  state_->current = std::make_shared<const MapSnapshot>(std::move(next));
  return state_->current;
}

void StaticMap::reset(std::uint64_t map_id) { state_->clear(map_id); }

const StaticMapConfig& StaticMap::config() const { return state_->config; }

bool StaticMap::State::reload(TileId id) {
  if (tile_store == nullptr || unreadable.contains(id)) return false;
  try {
    Resident resident{std::make_unique<LiveTile>(id, tile_store->load(id), grid), stored_step};
    tiles.emplace(id, std::move(resident));
  } catch (const std::runtime_error& fault) {
    // The tile is not mapped from now on: a new tile would replace the stored one.
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
  // Published first, so that the record agrees with the view even where only another rule, or a
  // mean rounded in the file, changed the tile.
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
  // Begins below the limit: the map grows on until the next checkpoint.
  if (state_->tile_store == nullptr || bytes <= limit_bytes - limit_bytes / 8) return 0;
  // Beyond the reach of scans, with a margin against reloading at once after a turn.
  const double near_m = state_->config.max_range_m + 2.0 * state_->config.tile_size_m;
  std::vector<std::pair<double, TileId>> candidates;
  for (const auto& [id, resident] : state_->tiles) {
    const double distance_m = state_->distance_m(id, position_map.head<2>());
    if (resident.changed_at <= state_->stored_step && distance_m > near_m) {
      candidates.emplace_back(distance_m, id);
    }
  }
  std::ranges::sort(candidates, std::greater<>());
  // More than needed, so that not every scan has to evict a tile.
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
