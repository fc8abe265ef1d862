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
    changed[i] = touched[i]->publish(version, state_->config.min_points, state_->grid) ? 1 : 0;
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
