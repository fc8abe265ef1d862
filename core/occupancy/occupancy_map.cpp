#include "core/occupancy/occupancy_map.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <limits>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"
#include "core/occupancy/occupancy_query.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "core/occupancy/octree_encoding.hpp"
#include "core/occupancy/octree_update.hpp"
#include "core/occupancy/scan_update.hpp"

namespace stillmap {
struct OccupancyMap::State {
  explicit State(const OccupancyConfig& occupancy_config)
      : config(occupancy_config), octree(occupancy_config.resolution_m) {
    octree.setProbHit(config.hit_probability);
    octree.setProbMiss(config.miss_probability);
    octree.setClampingThresMin(OccupancyConfig::min_probability);
    octree.setClampingThresMax(OccupancyConfig::max_probability);
  }

  void begin_update() {
    pending = {};
    bricks.clear();
  }

  /// Applies at most `max_bricks` of the pending bricks; returns whether more are left.
  bool apply(std::size_t max_bricks, const LogOddsSteps& steps) {
    const auto portion = pending.first(std::min(max_bricks, pending.size()));
    update_octree(octree, portion, steps);
    pending = pending.subspan(portion.size());
    if (!pending.empty()) return true;
    ++version;
    return false;
  }

  OccupancyConfig config;
  octomap::OcTree octree;
  VoxelBricks bricks;
  /// The part of `bricks` that has not been applied.
  std::span<const VoxelBrick> pending;
  std::uint64_t version = 0;
  std::uint64_t scans = 0;
  /// The view whose residency the octree has.
  MapSnapshot followed;
};

namespace {

const OccupancyConfig& checked(const OccupancyConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  return config;
}

/// Its resolution may be one that no map here is made with.
OccupancyConfig config_of(const OctomapData& data) {
  if (const OctomapCheck check = check_octomap(data); !check.fault.empty()) {
    throw std::invalid_argument("octomap data is damaged: " + check.fault);
  }
  OccupancyConfig config;
  config.resolution_m = data.resolution_m;
  return config;
}

/// Adds hits for all voxels whose interior a cube touches; false, and none, if it reaches out of
/// the octree.
bool add_cube(const Eigen::Vector3d& centre_map, double side_m, double resolution_m,
              VoxelBricks& bricks) {
  const Eigen::Vector3d centre = (centre_map / resolution_m).array() + octree_origin;
  // Slightly smaller, so that a cube of a voxel's size touches one voxel.
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.49 * side_m / resolution_m);
  if (!in_octree(centre - half) || !in_octree(centre + half)) return false;
  const VoxelKey first = (centre - half).array().floor().cast<std::int32_t>();
  const VoxelKey last = (centre + half).array().floor().cast<std::int32_t>();
  for (VoxelKey v = first; v.x() <= last.x(); ++v.x()) {
    for (v.y() = first.y(); v.y() <= last.y(); ++v.y()) {
      for (v.z() = first.z(); v.z() <= last.z(); ++v.z()) {
        bricks.brick_of(v).hits |= VoxelBricks::bit_of(v);
      }
    }
  }
  return true;
}

/// Unknown until one of its tiles is reloaded.
bool is_evicted(const ColumnTiles& tiles) {
  return tiles.has_non_resident && tiles.resident.empty();
}

}  // namespace

OccupancyMap::OccupancyMap(const OccupancyConfig& config)
    : state_(std::make_unique<State>(checked(config))) {}

OccupancyMap::OccupancyMap(const OctomapData& data)
    : state_(std::make_unique<State>(config_of(data))) {
  if (data.bytes.empty()) return;
  std::istringstream in(data.bytes);
  data.encoding == OctomapEncoding::binary ? state_->octree.readBinaryData(in)
                                           : state_->octree.readData(in);
}

OccupancyMap::~OccupancyMap() = default;
OccupancyMap::OccupancyMap(OccupancyMap&&) noexcept = default;
OccupancyMap& OccupancyMap::operator=(OccupancyMap&&) noexcept = default;

void OccupancyMap::insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                          const ScanUpdateOptions& use) {
  compute_update(scan, T_map_lidar, use);
  apply_update();
}

void OccupancyMap::compute_update(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                                  const ScanUpdateOptions& use, const ThrottleCallback& throttle) {
  ScanUpdateOptions options = use;
  const bool is_due = state_->scans++ % state_->config.clearing_interval == 0;
  options.clear_free_space =
      use.clear_free_space && is_due && state_->config.clearing_range_m > 0.0;
  state_->begin_update();
  compute_scan_update(state_->config, scan, T_map_lidar, options, state_->bricks, throttle);
  state_->pending = state_->bricks.sorted();
}

bool OccupancyMap::apply_update(std::size_t max_bricks) {
  return state_->apply(max_bricks,
                       {state_->octree.getProbHitLog(), state_->octree.getProbMissLog()});
}

std::size_t OccupancyMap::insert(const MapSnapshot& view, const ThrottleCallback& throttle) {
  if (view.tiles.empty()) return 0;
  const VoxelGrid grid(view.voxel_size_m, view.tile_size_m);
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(view.voxel_size_m / 2.0);
  // Finer voxels fill those of the static map; coarser ones are those that contain its points.
  const bool is_finer = state_->config.resolution_m <= view.voxel_size_m;
  const double side_m = is_finer ? view.voxel_size_m : 0.0;
  std::size_t left_out = 0;
  state_->begin_update();
  for (const auto& tile : view.tiles) {
    if (tile->voxels.empty()) continue;
    if (throttle) throttle();
    for (const Voxel& voxel : tile->voxels) {
      const Eigen::Vector3d centre_map = grid.corner_map(tile->info.id, voxel.index) + half;
      if (!add_cube(is_finer ? centre_map : voxel.mean_map.cast<double>(), side_m,
                    state_->config.resolution_m, state_->bricks))
        ++left_out;
    }
  }
  state_->pending = state_->bricks.sorted();
  const float max_log_odds = state_->octree.getClampingThresMaxLog();
  while (state_->apply(portion_bricks, {2.0F * max_log_odds, 0.0F})) {
    if (throttle) throttle();
  }
  // Those of a whole map would be walked through with every scan that follows.
  state_->pending = {};
  state_->bricks = {};
  return left_out;
}

double OccupancyMap::reach_m() const {
  // The margin of in_octree().
  return (octree_side - octree_origin - 1) * state_->config.resolution_m;
}

void OccupancyMap::begin_residency(const MapSnapshot& view) { state_->followed = view; }

bool OccupancyMap::sync_residency(const MapSnapshot& view) {
  const double resolution_m = state_->config.resolution_m;
  const MapSnapshot before = std::exchange(state_->followed, view);
  std::set<OctreeColumn> changed;
  std::vector<std::shared_ptr<const Tile>> reloaded_tiles;
  const auto is_away = [](const auto& tile) { return tile && is_non_resident(*tile); };
  TileTable::for_each_difference(before.tiles, view.tiles, [&](const auto& old, const auto& now) {
    if (is_away(old) == is_away(now)) return;
    // Also where its columns are known by other tiles.
    if (is_away(old) && now) reloaded_tiles.push_back(now);
    const TileId id = (old ? old : now)->info.id;
    const auto columns = columns_of(id, view.tile_size_m, resolution_m);
    changed.insert(columns.begin(), columns.end());
  });
  std::set<OctreeColumn> evicted;
  for (const OctreeColumn column : changed) {
    const ColumnTiles tiles = tiles_of(column, view, resolution_m);
    const bool was_evicted = is_evicted(tiles_of(column, before, resolution_m));
    if (is_evicted(tiles) && !was_evicted) evicted.insert(column);
    if (was_evicted && !is_evicted(tiles)) {
      reloaded_tiles.insert(reloaded_tiles.end(), tiles.resident.begin(), tiles.resident.end());
    }
  }
  if (!evicted.empty()) {
    evict_columns(state_->octree, evicted);
    ++state_->version;
  }
  // A tile that touches two columns is named twice.
  std::ranges::sort(reloaded_tiles);
  reloaded_tiles.erase(std::unique(reloaded_tiles.begin(), reloaded_tiles.end()),
                       reloaded_tiles.end());
  insert(
      {view.version, view.map_id, view.tile_size_m, view.voxel_size_m, TileTable(reloaded_tiles)});
  return !evicted.empty() || !reloaded_tiles.empty();
}

PointOccupancy OccupancyMap::at_point(const Eigen::Vector3d& p_map) const {
  return query_point(state_->octree, p_map);
}

BoxOccupancy OccupancyMap::in_box(const Eigen::AlignedBox3d& box_map,
                                  std::size_t max_voxels) const {
  std::size_t nodes_left = std::numeric_limits<std::size_t>::max();
  return query_box(state_->octree, box_map, max_voxels, nodes_left);
}

RayOccupancy OccupancyMap::along_ray(const RayQuery& ray) const {
  return cast_ray(state_->octree, ray);
}

OccupancyAnswers OccupancyMap::answer(const OccupancyQuery& query,
                                      const ThrottleCallback& pause) const {
  if (const std::string faults = query.faults(); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  OccupancyAnswers answers{.resolution_m = resolution_m(), .points = {}, .boxes = {}, .rays = {}};
  for (const Eigen::Vector3d& p_map : query.points_map) {
    if (pause) pause();
    answers.points.push_back(at_point(p_map));
  }
  std::size_t voxels_left = query.max_voxels;
  std::size_t nodes_left = OccupancyQuery::max_box_nodes;
  for (const Eigen::AlignedBox3d& box_map : query.boxes_map) {
    answers.boxes.push_back(query_box(state_->octree, box_map, voxels_left, nodes_left, pause));
    voxels_left -= answers.boxes.back().occupied_map.size();
  }
  for (const RayQuery& ray : query.rays) {
    if (pause) pause();
    answers.rays.push_back(cast_ray(state_->octree, ray, pause));
  }
  return answers;
}

OctomapData OccupancyMap::encode(OctomapEncoding encoding, const ThrottleCallback& pause) const {
  return {encoding, state_->config.resolution_m, encode_octree(state_->octree, encoding, pause)};
}

std::uint64_t OccupancyMap::version() const { return state_->version; }

double OccupancyMap::resolution_m() const { return state_->config.resolution_m; }

OccupancySize OccupancyMap::size() const {
  return {state_->octree.size(), state_->octree.memoryUsage()};
}

}  // namespace stillmap
