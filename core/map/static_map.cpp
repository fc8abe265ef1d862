#include "core/map/static_map.hpp"

#include <tbb/parallel_for.h>
#include <tsl/robin_map.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <memory>
#include <set>
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
  /// What the last view, or the next one, has of the tile; null where it shows nothing.
  [[nodiscard]] std::shared_ptr<const Tile> shown(TileId id) const;
  [[nodiscard]] bool is_known_non_resident(TileId id) const;
  /// Reads a non-resident tile from the tile store; false when it cannot be read.
  bool reload(TileId id);
  void add_resident(TileId id, const TileRecord& record);
  void evict(TileId id);
  /// The tile changed in this step; `is_published`: what it shows may have, too.
  void touch(LiveTile& live, bool is_published = true);
  /// Tiles in memory whose footprint comes this near.
  [[nodiscard]] std::vector<LiveTile*> tiles_near(const Eigen::Vector3f& position_map,
                                                  double range_m) const;
  /// From the tile's footprint [m].
  [[nodiscard]] double distance_m(TileId id, const Eigen::Vector2d& position_map) const;
  /// Scans from a position reach tiles that are this near, with a margin of two tiles [m].
  [[nodiscard]] double reach_m() const { return config.max_range_m + 2.0 * config.tile_size_m; }
  [[nodiscard]] std::size_t memory_bytes() const;
  [[nodiscard]] std::vector<LiveTile*> tiles_to_store(CheckpointScope scope) const;

  StaticMapConfig config;
  VoxelGrid grid;
  ScanSorter sorter;
  /// When the scans were that voxels of resident tiles name.
  ScanStamps stamps;
  tsl::robin_map<TileId, Resident, TileIdHash> tiles;
  /// In the tile store alone, and without any voxel to show. Other tiles that are not in `tiles`
  /// but in the view are there, too.
  std::set<TileId> hidden_non_resident;
  /// Both kinds.
  std::size_t non_resident_count = 0;
  std::shared_ptr<TileStore> tile_store;
  /// Why tiles that are non-resident could not be read.
  std::map<TileId, std::string> unreadable;
  /// Tiles with points since the last view; a tile may be named more than once.
  std::vector<LiveTile*> touched;
  bool is_frozen = false;
  /// What the next view shows otherwise than the last one.
  std::map<TileId, std::shared_ptr<const Tile>> edits;
  /// Resident tiles that changed since they were stored.
  std::set<TileId> unsaved;
  /// Tiles of the checkpoint that was taken last.
  std::vector<TileId> in_checkpoint;
  /// Scans so far.
  std::uint64_t inserted = 0;
  /// Counts the changes of tiles.
  std::uint64_t step = 1;
  /// The last view.
  std::shared_ptr<const MapSnapshot> current;
};

StaticMap::State::State(const StaticMapConfig& map_config)
    : config(map_config), grid(usable_grid(map_config)), sorter(grid, map_config.max_range_m) {
  clear(0);
}

void StaticMap::State::clear(std::uint64_t map_id) {
  tiles.clear();
  stamps.clear();
  hidden_non_resident.clear();
  non_resident_count = 0;
  unreadable.clear();
  touched.clear();
  edits.clear();
  unsaved.clear();
  in_checkpoint.clear();
  inserted = 0;
  ++step;
  MapSnapshot empty;
  empty.map_id = map_id;
  empty.tile_size_m = config.tile_size_m;
  empty.voxel_size_m = config.voxel_size_m;
  current = std::make_shared<const MapSnapshot>(std::move(empty));
}

LiveTile* StaticMap::State::tile(TileId id) {
  if (const auto known = tiles.find(id); known != tiles.end()) return known->second.live.get();
  if (is_known_non_resident(id)) {
    return reload(id) ? tiles.find(id)->second.live.get() : nullptr;
  }
  Resident fresh{std::make_unique<LiveTile>(id, grid), step};
  return tiles.emplace(id, std::move(fresh)).first->second.live.get();
}

std::shared_ptr<const Tile> StaticMap::State::shown(TileId id) const {
  const auto edited = edits.find(id);
  return edited != edits.end() ? edited->second : current->tiles.find(id);
}

bool StaticMap::State::is_known_non_resident(TileId id) const {
  return !tiles.contains(id) && (hidden_non_resident.contains(id) || shown(id) != nullptr);
}

void StaticMap::State::touch(LiveTile& live, bool is_published) {
  if (is_published) touched.push_back(&live);
  tiles.find(live.id()).value().changed_at = step;
  unsaved.insert(live.id());
}

double StaticMap::State::distance_m(TileId id, const Eigen::Vector2d& position_map) const {
  const Eigen::Vector2d low = Eigen::Vector2d(id.x, id.y) * grid.tile_size_m();
  const Eigen::AlignedBox2d footprint(low, low.array() + grid.tile_size_m());
  return footprint.exteriorDistance(position_map);
}

std::vector<LiveTile*> StaticMap::State::tiles_near(const Eigen::Vector3f& position_map,
                                                    double range_m) const {
  const Eigen::Vector2d position = position_map.head<2>().cast<double>();
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(range_m);
  const Eigen::Vector3d centre = position_map.cast<double>();
  std::vector<LiveTile*> near;
  const TileRange range = tile_range({centre - reach, centre + reach}, grid.tile_size_m());
  for (TileId id = range.first; id.x <= range.last.x; ++id.x) {
    for (id.y = range.first.y; id.y <= range.last.y; ++id.y) {
      const auto known = tiles.find(id);
      if (known == tiles.end() || distance_m(id, position) > range_m) continue;
      near.push_back(known->second.live.get());
    }
  }
  return near;
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
  const std::uint32_t number = state_->stamps.add(scan.scan.stamp_ns);
  std::vector<LiveTile*> hit(batches.size());
  std::ranges::transform(batches, hit.begin(),
                         [&](const auto& batch) { return state_->tile(batch.tile); });
  // A tile belongs to one task, which takes its points in the order of the scan: the map does not
  // depend on how many threads there are.
  tbb::parallel_for(std::size_t{0}, hit.size(), [&](std::size_t i) {
    if (hit[i] != nullptr) hit[i]->insert(batches[i].points, number);
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
  const std::uint32_t scan = state_->stamps.add(stamp_ns);
  std::vector<std::uint8_t> hides(near.size());
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t i) {
    hides[i] = near[i]->clear_seen_through(is_free, scan, state_->rule()) ? 1 : 0;
  });
  ++state_->step;
  for (std::size_t i = 0; i < near.size(); ++i) {
    // Counts changed in all of them; only tiles with a voxel to hide are published again.
    state_->touch(*near[i], hides[i] != 0);
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
    changed[i] = touched[i]->publish(version, state_->rule(), state_->stamps) ? 1 : 0;
  });
  for (std::size_t i = 0; i < touched.size(); ++i) {
    if (changed[i] != 0) state_->edits[touched[i]->id()] = touched[i]->published();
  }
  if (state_->edits.empty()) return state_->current;

  const bool has_changed = std::ranges::find(changed, 1) != changed.end();
  std::vector<TileTable::Edit> edits;
  edits.reserve(state_->edits.size());
  for (auto& [id, tile] : state_->edits) edits.push_back({id, std::move(tile)});
  state_->edits.clear();
  state_->current = std::make_shared<const MapSnapshot>(MapSnapshot{
      has_changed ? version : state_->current->version, state_->current->map_id,
      state_->config.tile_size_m, state_->config.voxel_size_m, state_->current->tiles.with(edits)});
  return state_->current;
}

void StaticMap::reset(std::uint64_t map_id) { state_->clear(map_id); }

const StaticMapConfig& StaticMap::config() const { return state_->config; }

void StaticMap::State::add_resident(TileId id, const TileRecord& record) {
  tiles.emplace(id, Resident{std::make_unique<LiveTile>(id, record, grid, stamps), 0});
}

bool StaticMap::State::reload(TileId id) {
  if (tile_store == nullptr || unreadable.contains(id)) return false;
  const std::shared_ptr<const Tile> stub = shown(id);
  try {
    TileRecord record = tile_store->load(id);
    if (record.tile && stub && stub->info.appeared_in != 0) {
      // The file does not know it.
      auto tile = std::make_shared<Tile>(*record.tile);
      tile->info.appeared_in = stub->info.appeared_in;
      record.tile = std::move(tile);
    }
    add_resident(id, record);
  } catch (const std::runtime_error& fault) {
    // The tile is not mapped from now on: a new tile would replace the stored one.
    unreadable.emplace(id, fault.what());
    return false;
  }
  --non_resident_count;
  hidden_non_resident.erase(id);
  const auto& published = tiles.find(id)->second.live->published();
  if (stub || published) edits[id] = published;
  return true;
}

void StaticMap::State::evict(TileId id) {
  const auto resident = tiles.find(id);
  const LiveTile& live = *resident->second.live;
  if (live.published()) {
    edits[id] = without_voxels(*live.published());
  } else {
    hidden_non_resident.insert(id);
  }
  ++non_resident_count;
  std::erase(touched, &live);
  tiles.erase(resident);
}

std::size_t StaticMap::State::memory_bytes() const {
  std::size_t bytes = non_resident_count * non_resident_tile_bytes + stamps.memory_bytes();
  for (const auto& [id, resident] : tiles) bytes += resident.live->memory_bytes();
  return bytes;
}

void StaticMap::use_tile_store(std::shared_ptr<TileStore> tile_store) {
  state_->tile_store = std::move(tile_store);
}

std::vector<LiveTile*> StaticMap::State::tiles_to_store(CheckpointScope scope) const {
  std::vector<LiveTile*> wanted;
  if (scope == CheckpointScope::everything) {
    for (const auto& [id, resident] : tiles) wanted.push_back(resident.live.get());
    return wanted;
  }
  for (const TileId id : unsaved) {
    LiveTile* const live = tiles.find(id)->second.live.get();
    if (scope == CheckpointScope::changed || live->view_has_changed()) wanted.push_back(live);
  }
  return wanted;
}

MapCheckpoint StaticMap::checkpoint(CheckpointScope scope) {
  // Published first, so that the record agrees with the view even where only another rule, or a
  // mean rounded in the file, changed the tile.
  const auto published_first = state_->tiles_to_store(
      scope == CheckpointScope::everything ? scope : CheckpointScope::changed);
  state_->touched.insert(state_->touched.end(), published_first.begin(), published_first.end());
  MapCheckpoint checkpoint{view(), state_->step++, {}};
  const std::vector<LiveTile*> wanted = state_->tiles_to_store(scope);
  std::vector<TileRecord> records(wanted.size());
  tbb::parallel_for(std::size_t{0}, wanted.size(), [&](std::size_t i) {
    records[i] = wanted[i]->record(state_->rule(), state_->stamps);
  });
  state_->in_checkpoint.clear();
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    wanted[i]->begin_recording();
    state_->in_checkpoint.push_back(wanted[i]->id());
    checkpoint.records.emplace(wanted[i]->id(), std::move(records[i]));
  }
  return checkpoint;
}

void StaticMap::checkpoint_stored(std::uint64_t step) {
  for (const TileId id : std::exchange(state_->in_checkpoint, {})) {
    const auto resident = state_->tiles.find(id);
    if (resident == state_->tiles.end()) continue;
    resident->second.live->end_recording();
    if (resident->second.changed_at <= step) state_->unsaved.erase(id);
  }
}

MemoryUse StaticMap::memory_use() const {
  return {state_->memory_bytes(), state_->tiles.size(), state_->non_resident_count};
}

std::size_t StaticMap::evict(const Eigen::Vector3d& position_map, std::size_t limit_bytes) {
  std::size_t bytes = state_->memory_bytes();
  // Begins below the limit: the map grows on until the next checkpoint.
  if (state_->tile_store == nullptr || bytes <= limit_bytes - limit_bytes / 8) return 0;
  std::vector<std::pair<double, TileId>> candidates;
  for (const auto& [id, resident] : state_->tiles) {
    const double distance_m = state_->distance_m(id, position_map.head<2>());
    if (distance_m > state_->reach_m() && !state_->unsaved.contains(id)) {
      candidates.emplace_back(distance_m, id);
    }
  }
  std::ranges::sort(candidates, std::greater<>());
  // More than needed, so that not every scan has to evict a tile.
  const std::size_t wanted_bytes = limit_bytes - limit_bytes / 4;
  std::size_t evicted_tiles = 0;
  for (const auto& [distance_m, id] : candidates) {
    if (bytes <= wanted_bytes) break;
    bytes -= std::min(bytes, state_->tiles.find(id)->second.live->memory_bytes());
    state_->evict(id);
    ++evicted_tiles;
  }
  return evicted_tiles;
}

std::vector<std::string> StaticMap::unreadable_tiles() const {
  std::vector<std::string> faults;
  for (const auto& [id, fault] : state_->unreadable) {
    faults.push_back("tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) + "): " + fault);
  }
  return faults;
}

std::vector<TileId> StaticMap::tiles_in(const Eigen::AlignedBox3d& box_map,
                                        std::size_t max_shown) const {
  const TileRange range = tile_range(box_map, state_->grid.tile_size_m());
  const auto is_in = [&](TileId id) {
    return id.x >= range.first.x && id.x <= range.last.x && id.y >= range.first.y &&
           id.y <= range.last.y;
  };
  std::vector<TileId> ids;
  for (const auto& tile : tiles_in_range(state_->current->tiles, range, max_shown)) {
    ids.push_back(tile->info.id);
  }
  for (const auto& [id, resident] : state_->tiles) {
    if (is_in(id)) ids.push_back(id);
  }
  std::ranges::copy_if(state_->hidden_non_resident, std::back_inserter(ids), is_in);
  std::ranges::sort(ids);
  const auto doubles = std::ranges::unique(ids);
  ids.erase(doubles.begin(), doubles.end());
  return ids;
}

StaticMap::RemovedVoxels StaticMap::removed(const Eigen::AlignedBox3d& box_map,
                                            std::span<const TileId> tiles) const {
  RemovedVoxels all;
  for (const TileId id : tiles) {
    const auto resident = state_->tiles.find(id);
    if (resident == state_->tiles.end()) {
      if (state_->is_known_non_resident(id)) all.non_resident.push_back(id);
      continue;
    }
    std::ranges::copy_if(resident->second.live->removed(state_->rule(), state_->stamps),
                         std::back_inserter(all.voxels), [&](const RemovedVoxel& voxel) {
                           return box_map.contains(voxel.position_map.cast<double>());
                         });
  }
  return all;
}

std::size_t StaticMap::restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                                       std::span<const TileId> tiles) {
  ++state_->step;
  std::size_t restored = 0;
  for (const TileId id : tiles) {
    if (state_->is_known_non_resident(id)) state_->reload(id);
    const auto resident = state_->tiles.find(id);
    if (resident == state_->tiles.end()) continue;
    LiveTile& live = *resident->second.live;
    const std::size_t voxels = live.restore(reason, box_map, state_->rule());
    if (voxels > 0) state_->touch(live);
    restored += voxels;
  }
  return restored;
}

void StaticMap::resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence) {
  check_sizes(view, state_->config);
  state_->clear(view.map_id);
  if (view.tiles.empty() && tile_evidence.empty()) return;
  state_->non_resident_count = view.tiles.non_resident_count();
  if (state_->non_resident_count < view.tiles.size()) {
    for (const auto& tile : view.tiles) {
      if (is_non_resident(*tile)) continue;
      const auto evidence = tile_evidence.find(tile->info.id);
      state_->add_resident(tile->info.id,
                           {tile, evidence == tile_evidence.end() ? nullptr : evidence->second});
    }
  }
  for (const auto& [id, evidence] : tile_evidence) {
    if (view.tiles.find(id) != nullptr) continue;
    if (evidence == nullptr) {
      state_->hidden_non_resident.insert(id);
      ++state_->non_resident_count;
    } else {
      state_->add_resident(id, {nullptr, evidence});
    }
  }
  MapSnapshot current = view;
  current.voxel_size_m = state_->config.voxel_size_m;
  current.tile_size_m = state_->config.tile_size_m;
  state_->current = std::make_shared<const MapSnapshot>(std::move(current));
}

void StaticMap::reload_near(const Eigen::Vector3d& position_map) {
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(state_->reach_m());
  const TileRange range =
      tile_range({position_map - reach, position_map + reach}, state_->grid.tile_size_m());
  for (TileId id = range.first; id.x <= range.last.x; ++id.x) {
    for (id.y = range.first.y; id.y <= range.last.y; ++id.y) {
      if (state_->distance_m(id, position_map.head<2>()) > state_->reach_m()) continue;
      if (state_->is_known_non_resident(id)) state_->reload(id);
    }
  }
}

}  // namespace stillmap
