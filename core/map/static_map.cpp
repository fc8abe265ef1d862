#include "core/map/static_map.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>
#include <stdexcept>
#include <utility>

#include "core/map/static_map_state.hpp"

namespace stillmap {
namespace {

/// Requires config without faults.
VoxelGrid usable_grid(const StaticMapConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument("static map: " + faults);
  }
  return {config.voxel_size_m, config.tile_size_m};
}

}  // namespace

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

bool StaticMap::clearing_due() const {
  return state_->config.clearing_range_m > 0.0 &&
         state_->inserted % state_->config.clearing_interval == 0;
}

void StaticMap::clear_seen_through(const RangeImageView& view, std::int64_t stamp_ns) {
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
    // Counts changed in all of them; only what hides something is to be shown anew.
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

}  // namespace stillmap
