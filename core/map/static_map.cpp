#include "core/map/static_map.hpp"

#include <tbb/parallel_for.h>
#include <tsl/robin_map.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/map/live_tile.hpp"
#include "core/map/scan_sorter.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

struct TileIdHash {
  std::size_t operator()(const TileId& id) const {
    const auto x = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.x));
    const auto y = static_cast<std::uint64_t>(static_cast<std::uint32_t>(id.y));
    return static_cast<std::size_t>(((x << 32 | y) * 0x9E3779B97F4A7C15ULL) >> 20);
  }
};

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

/// Requires config without faults.
VoxelGrid usable_grid(const StaticMapConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument("static map: " + faults);
  }
  return {config.voxel_size_m, config.tile_size_m};
}

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
  if (!(clear_range_m >= 0.0 && clear_range_m <= 1000.0)) {
    faults << "clear_range_m = " << clear_range_m << "; must be 0 (off) to 1000\n";
  }
  if (!(clear_margin_m >= voxel_size_m && clear_margin_m <= 100.0)) {
    faults << "clear_margin_m = " << clear_margin_m << "; must be at least voxel_size_m ("
           << voxel_size_m << ") and at most 100\n";
  }
  if (!(clear_margin_share >= 0.0 && clear_margin_share <= 1.0)) {
    faults << "clear_margin_share = " << clear_margin_share << "; must be 0 to 1\n";
  }
  if (look_every == 0 || look_every > 1000) {
    faults << "look_every = " << look_every << "; must be 1 to 1000\n";
  }
  if (passes == 0 || passes > 1000) faults << "passes = " << passes << "; must be 1 to 1000\n";
  if (passes_per_hit == 0 || passes_per_hit > 1000) {
    faults << "passes_per_hit = " << passes_per_hit << "; must be 1 to 1000\n";
  }
  if (min_points == 0) faults << "min_points = 0; must be at least 1\n";
  return faults.str();
}

struct StaticMap::State {
  explicit State(const StaticMapConfig& map_config)
      : config(map_config), grid(usable_grid(map_config)), sorter(grid, map_config.max_range_m) {
    clear(0);
  }

  void clear(std::uint64_t map_id) {
    tiles.clear();
    touched.clear();
    inserted = 0;
    MapView empty;
    empty.map_id = map_id;
    empty.tile_size_m = config.tile_size_m;
    empty.voxel_size_m = config.voxel_size_m;
    current = std::make_shared<const MapView>(std::move(empty));
  }

  LiveTile& tile(TileId id) {
    std::unique_ptr<LiveTile>& known = tiles[id];
    if (!known) known = std::make_unique<LiveTile>(id);
    return *known;
  }

  [[nodiscard]] VisibilityRule rule() const {
    return {config.min_points, config.passes, config.passes_per_hit};
  }

  /// Tiles whose footprint comes this near.
  [[nodiscard]] std::vector<LiveTile*> tiles_near(const Eigen::Vector3f& position_map,
                                                  double range_m) const {
    std::vector<LiveTile*> near;
    for (const auto& [id, live] : tiles) {
      const Eigen::Vector2d low = Eigen::Vector2d(id.x, id.y) * grid.tile_size_m();
      const Eigen::AlignedBox2d footprint(low, low.array() + grid.tile_size_m());
      const Eigen::Vector2d position = position_map.head<2>().cast<double>();
      if (footprint.squaredExteriorDistance(position) <= range_m * range_m) {
        near.push_back(live.get());
      }
    }
    return near;
  }

  [[nodiscard]] std::vector<std::shared_ptr<const Tile>> published_tiles() const {
    std::vector<std::shared_ptr<const Tile>> published;
    published.reserve(tiles.size());
    for (const auto& [id, live] : tiles) {
      if (live->published()) published.push_back(live->published());
    }
    std::ranges::sort(published, {}, [](const auto& shared) { return shared->info.id; });
    return published;
  }

  StaticMapConfig config;
  VoxelGrid grid;
  ScanSorter sorter;
  tsl::robin_map<TileId, std::unique_ptr<LiveTile>, TileIdHash> tiles;
  /// Tiles with points since the last view; each once, as publishing forgets them all.
  std::vector<LiveTile*> touched;
  /// Scans so far.
  std::uint64_t inserted = 0;
  /// The last view.
  std::shared_ptr<const MapView> current;
};

StaticMap::StaticMap(const StaticMapConfig& config) : state_(std::make_unique<State>(config)) {}
StaticMap::~StaticMap() = default;
StaticMap::StaticMap(StaticMap&&) noexcept = default;
StaticMap& StaticMap::operator=(StaticMap&&) noexcept = default;

void StaticMap::insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar) {
  assert(scan.motion.size() == scan.scan.size());
  assert(scan.labels.empty() || scan.labels.classes.size() == scan.scan.size());
  const auto batches = state_->sorter.sort(scan, T_map_lidar);
  std::vector<LiveTile*> hit(batches.size());
  std::ranges::transform(batches, hit.begin(),
                         [&](const auto& batch) { return &state_->tile(batch.tile); });
  // A tile belongs to one task, which takes its points in the order of the scan: the map does not
  // depend on how many threads there are.
  tbb::parallel_for(std::size_t{0}, hit.size(),
                    [&](std::size_t i) { hit[i]->insert(batches[i].points, scan.scan.stamp_ns); });
  state_->touched.insert(state_->touched.end(), hit.begin(), hit.end());
  ++state_->inserted;
}

bool StaticMap::wants_look() const {
  return state_->config.clear_range_m > 0.0 && state_->inserted % state_->config.look_every == 0;
}

void StaticMap::look_through(const RangeView& view, std::int64_t stamp_ns) {
  const StaticMapConfig& config = state_->config;
  const auto is_free = [&](const Eigen::Vector3f& position_map) {
    const double range_m = (position_map - view.origin_map()).norm();
    if (range_m > config.clear_range_m) return false;
    const auto sight = view.look_at(position_map);
    return sight &&
           sight->nearest_m > range_m + config.clear_margin_m + config.clear_margin_share * range_m;
  };
  const std::vector<LiveTile*> near = state_->tiles_near(view.origin_map(), config.clear_range_m);
  std::vector<std::uint8_t> hides(near.size());
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t i) {
    hides[i] = near[i]->look_through(is_free, stamp_ns, state_->rule(), state_->grid) ? 1 : 0;
  });
  for (std::size_t i = 0; i < near.size(); ++i) {
    if (hides[i] != 0) state_->touched.push_back(near[i]);
  }
}

std::vector<RemovedVoxel> StaticMap::removed() const {
  std::vector<RemovedVoxel> all;
  for (const auto& [id, live] : state_->tiles) {
    const std::vector<RemovedVoxel> removed = live->removed(state_->rule(), state_->grid);
    all.insert(all.end(), removed.begin(), removed.end());
  }
  return all;
}

std::size_t StaticMap::restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
  std::size_t restored = 0;
  for (const auto& [id, live] : state_->tiles) {
    restored += live->restore(reason, box_map, state_->rule(), state_->grid);
    state_->touched.push_back(live.get());
  }
  return restored;
}

ClassEvidence StaticMap::evidence_at(const Eigen::Vector3d& position_map) const {
  if (!state_->grid.holds(position_map)) return {};
  const VoxelGrid::Place place = state_->grid.place(position_map);
  const auto tile = state_->tiles.find(place.tile);
  return tile == state_->tiles.end() ? ClassEvidence()
                                     : tile->second->evidence(voxel_key(place.voxel));
}

std::shared_ptr<const MapView> StaticMap::view() {
  std::vector<LiveTile*> touched = std::exchange(state_->touched, {});
  std::ranges::sort(touched);
  touched.erase(std::ranges::unique(touched).begin(), touched.end());

  const std::uint64_t version = state_->current->version + 1;
  std::vector<std::uint8_t> changed(touched.size());
  tbb::parallel_for(std::size_t{0}, touched.size(), [&](std::size_t i) {
    changed[i] = touched[i]->publish(version, state_->rule(), state_->grid) ? 1 : 0;
  });
  if (std::ranges::find(changed, 1) == changed.end()) return state_->current;

  MapView next = {version, state_->current->map_id, state_->config.tile_size_m,
                  state_->config.voxel_size_m, state_->published_tiles()};
  state_->current = std::make_shared<const MapView>(std::move(next));
  return state_->current;
}

void StaticMap::restore(const MapView& view) {
  const StaticMapConfig& config = state_->config;
  if (view.tiles.empty()) {
    state_->clear(view.map_id);
    return;
  }
  if (std::abs(view.voxel_size_m - config.voxel_size_m) > 1e-9 ||
      std::abs(view.tile_size_m - config.tile_size_m) > 1e-9) {
    std::ostringstream fault;
    fault << "the stored map has voxel_size_m " << view.voxel_size_m << " and tile_size_m "
          << view.tile_size_m << ", the configuration has " << config.voxel_size_m << " and "
          << config.tile_size_m << ": configure the stored sizes, or start a new map";
    throw std::invalid_argument(fault.str());
  }
  state_->clear(view.map_id);
  for (const auto& tile : view.tiles) {
    state_->tiles[tile->info.id] = std::make_unique<LiveTile>(tile, state_->grid);
  }
  state_->current = std::make_shared<const MapView>(view);
}

void StaticMap::reset(std::uint64_t map_id) { state_->clear(map_id); }

const StaticMapConfig& StaticMap::config() const { return state_->config; }

}  // namespace stillmap
