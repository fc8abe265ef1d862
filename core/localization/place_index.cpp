#include "core/localization/place_index.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// A voxel without a class stands up when it is so far above the lowest one of its cell [m].
constexpr float standing_height_m = 0.5F;
/// Ground is fitted to the lowest voxels of cells as near as this [m].
constexpr int ground_radius_m = 8;
/// Streets are no steeper, and so much of what is lowest lies on them.
constexpr double max_slope = 0.35;
constexpr double min_ground_share = 0.3;
/// How far below a path its ground may be, and above [m].
constexpr float max_ground_below_m = 6.0F;
constexpr float max_ground_above_m = 0.5F;
/// Of a path whose ground is not known [m].
constexpr double usual_body_height_m = 1.7;

std::uint64_t cell_key(int x, int y) { return packed_index(x, y, 0); }

/// What of one tile enters the index.
struct TileContent {
  std::vector<Eigen::Vector3f> standing_map;
  /// Lowest ground of coarse cells, by their keys.
  std::map<std::uint64_t, float> lowest;
};

struct Cell {
  float lowest = 0.0F;
  /// Of voxels of a ground class.
  std::optional<float> ground;
};

bool is_standing(SemanticClass label, float above_lowest_m) {
  if (label == SemanticClass::unlabeled) return above_lowest_m > standing_height_m;
  return !is_ground(label) && !is_movable(label);
}

TileContent content_of(const Tile& tile, const LayeredCells& coarse) {
  std::map<std::uint64_t, Cell> cells;
  const auto key_of = [&](const Eigen::Vector3f& p) {
    return cell_key(coarse.index(static_cast<double>(p.x())),
                    coarse.index(static_cast<double>(p.y())));
  };
  for (const Voxel& voxel : tile.voxels) {
    const float z = voxel.mean_map.z();
    Cell& cell = cells.try_emplace(key_of(voxel.mean_map), Cell{z, std::nullopt}).first->second;
    cell.lowest = std::min(cell.lowest, z);
    if (is_ground(voxel.evidence.winner())) cell.ground = std::min(cell.ground.value_or(z), z);
  }
  TileContent content;
  bool is_labelled = false;
  for (const Voxel& voxel : tile.voxels) {
    const SemanticClass label = voxel.evidence.winner();
    is_labelled |= label != SemanticClass::unlabeled;
    const Cell& cell = cells.at(key_of(voxel.mean_map));
    if (is_standing(label, voxel.mean_map.z() - cell.lowest))
      content.standing_map.push_back(voxel.mean_map);
  }
  for (const auto& [key, cell] : cells) {
    if (cell.ground || !is_labelled) content.lowest[key] = cell.ground.value_or(cell.lowest);
  }
  return content;
}

}  // namespace

PlaceIndex::PlaceIndex(std::shared_ptr<const MapSnapshot> map, const SharedTrajectory& trajectory,
                       std::shared_ptr<TileReader> tiles, const PlaceIndexConfig& config)
    : map_(std::move(map)),
      tiles_(std::move(tiles)),
      config_(config),
      coarse_(config.coarse),
      fine_(config.fine) {
  const LowestHeights lowest = fill_cells();
  place_nodes(trajectory, lowest);
  place_blocks();
}

PlaceIndex::LowestHeights PlaceIndex::fill_cells() {
  LowestHeights lowest;
  const std::vector<TileTable::SharedTile> all(map_->tiles.begin(), map_->tiles.end());
  // A few at a time: those that are on disk need not be in memory together.
  constexpr std::size_t portion = 64;
  for (std::size_t begin = 0; begin < all.size(); begin += portion) {
    std::vector<TileContent> contents(std::min(portion, all.size() - begin));
    tbb::parallel_for(std::size_t{0}, contents.size(), [&](std::size_t k) {
      contents[k] = content_of(*tiles_->read(all[begin + k]), coarse_);
    });
    for (const TileContent& content : contents) {
      for (const Eigen::Vector3f& p_map : content.standing_map) {
        coarse_.insert(p_map);
        fine_.insert(p_map);
      }
      for (const auto& [key, height] : content.lowest) {
        const auto [entry, is_new] = lowest.try_emplace(key, height);
        if (!is_new) entry.value() = std::min(entry->second, height);
      }
    }
  }
  return lowest;
}

void PlaceIndex::place_nodes(const SharedTrajectory& trajectory, const LowestHeights& lowest) {
  if (trajectory.empty()) return place_nodes_on_ground(lowest);
  tsl::robin_map<std::uint64_t, bool, IndexHash> taken;
  std::vector<float> path_heights_m;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d p = pose.T_map_lidar.translation();
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > VoxelGrid::max_coordinate_m) continue;
    const auto index = [&](double m) {
      return static_cast<int>(std::floor(m / config_.node_spacing_m));
    };
    if (!taken.try_emplace(cell_key(index(p.x()), index(p.y())), true).second) continue;
    nodes_.push_back({p.head<2>(), {}, 0.0});
    path_heights_m.push_back(static_cast<float>(p.z()));
  }
  fit_ground(lowest, path_heights_m);
}

void PlaceIndex::place_nodes_on_ground(const LowestHeights& lowest) {
  std::vector<float> path_heights_m;
  const int step = std::max(1, static_cast<int>(config_.node_spacing_m / config_.coarse.cell_m));
  for (const auto& [key, height] : lowest) {
    const auto [x, y, z] = unpacked_index(key);
    if (x % step != 0 || y % step != 0) continue;
    nodes_.push_back({config_.coarse.cell_m * Eigen::Vector2d(x + 0.5, y + 0.5), {}, 0.0});
    path_heights_m.push_back(height + static_cast<float>(usual_body_height_m));
  }
  fit_ground(lowest, path_heights_m);
}

void PlaceIndex::fit_ground(const LowestHeights& lowest, const std::vector<float>& path_heights_m) {
  std::vector<std::uint8_t> is_fitted(nodes_.size(), 0);
  const int radius = static_cast<int>(ground_radius_m / config_.coarse.cell_m);
  tbb::parallel_for(std::size_t{0}, nodes_.size(), [&](std::size_t k) {
    const Eigen::Vector2d& position_map = nodes_[k].position_map;
    const int node_x = coarse_.index(position_map.x());
    const int node_y = coarse_.index(position_map.y());
    std::vector<Eigen::Vector3f> around;
    for (int y = node_y - radius; y <= node_y + radius; ++y) {
      for (int x = node_x - radius; x <= node_x + radius; ++x) {
        const auto entry = lowest.find(cell_key(x, y));
        if (entry == lowest.end()) continue;
        const float below_m = path_heights_m[k] - entry->second;
        if (below_m > max_ground_below_m || below_m < -max_ground_above_m) continue;
        const Eigen::Vector2d centre = config_.coarse.cell_m * Eigen::Vector2d(x + 0.5, y + 0.5);
        const Eigen::Vector2f from_node = (centre - position_map).cast<float>();
        around.emplace_back(from_node.x(), from_node.y(), entry->second);
      }
    }
    const auto ground = fit_level_plane(around, max_slope, min_ground_share);
    if (!ground) return;
    nodes_[k].ground = *ground;
    nodes_[k].body_height_m = static_cast<double>(path_heights_m[k]) - ground->height_m;
    is_fitted[k] = 1;
  });
  std::vector<double> heights;
  for (std::size_t k = 0; k < nodes_.size(); ++k)
    if (is_fitted[k] != 0) heights.push_back(nodes_[k].body_height_m);
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  const double usual_m = heights.empty() ? usual_body_height_m : *middle;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (is_fitted[k] != 0) continue;
    nodes_[k].ground.height_m = static_cast<double>(path_heights_m[k]) - usual_m;
    nodes_[k].body_height_m = usual_m;
  }
}

void PlaceIndex::place_blocks() {
  std::map<std::pair<int, int>, std::size_t> block_of;
  std::vector<double> nearest_m;
  const double cell_m = config_.coarse.cell_m;
  const int reach = static_cast<int>(std::ceil(config_.corridor_m / cell_m));
  const auto block_at = [&](int x, int y) -> Block& {
    const auto column = static_cast<int>(std::floor(static_cast<double>(x) / block_width));
    const auto row = static_cast<int>(std::floor(static_cast<double>(y) / block_height));
    const auto [entry, is_new] = block_of.try_emplace({row, column}, blocks_.size());
    if (is_new) {
      blocks_.push_back({column * block_width, row * block_height, {}, 0});
      blocks_.back().is_searched.assign(std::size_t{block_width} * block_height, 0);
      nearest_m.push_back(1e9);
    }
    return blocks_[entry->second];
  };
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const Eigen::Vector2d& position_map = nodes_[k].position_map;
    const int node_x = coarse_.index(position_map.x());
    const int node_y = coarse_.index(position_map.y());
    for (int y = node_y - reach; y <= node_y + reach; ++y) {
      for (int x = node_x - reach; x <= node_x + reach; ++x) {
        const Eigen::Vector2d centre = cell_m * Eigen::Vector2d(x + 0.5, y + 0.5);
        if ((centre - position_map).norm() > config_.corridor_m) continue;
        Block& block = block_at(x, y);
        block.is_searched[static_cast<std::size_t>((y - block.first_y) * block_width +
                                                   (x - block.first_x))] = 1;
        const Eigen::Vector2d middle = cell_m * Eigen::Vector2d(block.first_x + 0.5 * block_width,
                                                                block.first_y + 0.5 * block_height);
        double& nearest = nearest_m[static_cast<std::size_t>(&block - blocks_.data())];
        if ((middle - position_map).norm() >= nearest) continue;
        nearest = (middle - position_map).norm();
        block.node = static_cast<std::uint32_t>(k);
      }
    }
  }
}

std::vector<LabelledPoint> PlaceIndex::points_near(const Eigen::Vector2d& position_map,
                                                   double radius_m) const {
  constexpr double any_height_m = VoxelGrid::max_coordinate_m;
  const Eigen::Vector3d centre(position_map.x(), position_map.y(), 0.0);
  const Eigen::Vector3d reach(radius_m, radius_m, any_height_m);
  const auto near = tiles_in_box(*map_, {centre - reach, centre + reach});
  std::vector<std::vector<LabelledPoint>> of_tile(near.size());
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t k) {
    const Eigen::Vector2f centre_map = position_map.cast<float>();
    const auto radius = static_cast<float>(radius_m);
    const auto tile = tiles_->read(near[k]);
    for (const PackedVoxel& voxel : tile->voxels.packed()) {
      const Eigen::Vector3f p = mean_map(voxel, tile->info.id, tile->voxels.grid());
      if ((p.head<2>() - centre_map).squaredNorm() < radius * radius)
        of_tile[k].push_back({p, voxel.evidence.winner()});
    }
  });
  std::vector<LabelledPoint> points;
  for (const auto& found : of_tile) points.insert(points.end(), found.begin(), found.end());
  return points;
}

std::size_t PlaceIndex::memory_bytes() const {
  return coarse_.memory_bytes() + fine_.memory_bytes() + nodes_.capacity() * sizeof(PathNode) +
         blocks_.size() * (sizeof(Block) + std::size_t{block_width} * block_height);
}

}  // namespace stillmap
