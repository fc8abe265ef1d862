#include "core/localization/place_index.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "core/lidar/ranked_value.hpp"
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

/// A lidar fits between the storeys of a car park [m].
constexpr float min_storey_gap_m = 1.8F;
/// Paths so far one above another, on so much of the plane, are on different storeys, and no slope
/// [m].
constexpr float min_storey_height_m = 2.4F;
constexpr double storey_cell_m = 6.0;
/// Ground of the nodes of one block differs by no more, or a ramp would join two storeys [m].
constexpr double max_block_step_m = 0.8;
/// Floors of a place that are so far apart are two [m].
constexpr double min_floor_step_m = 1.2;

/// What of one tile enters the index.
struct TileContent {
  std::vector<Eigen::Vector3f> standing_map;
  /// Ground of coarse cells, by their keys, the lowest first.
  std::map<std::uint64_t, std::vector<float>> floors;
};

struct Cell {
  float lowest = 0.0F;
  /// Of voxels of a ground class.
  std::optional<float> ground;
  /// Of all voxels, and of those of a ground class, where there are storeys.
  std::vector<float> heights{}, ground_heights{};

  /// The lowest height, and each that has a storey's gap below it.
  static std::vector<float> floors_of(std::vector<float>& heights) {
    std::ranges::sort(heights);
    std::vector<float> floors;
    for (std::size_t i = 0; i < heights.size(); ++i)
      if (i == 0 || heights[i] - heights[i - 1] > min_storey_gap_m) floors.push_back(heights[i]);
    return floors;
  }
  /// Of what the height stands on.
  [[nodiscard]] float floor_below(const std::vector<float>& floors, float height) const {
    float below = lowest;
    for (const float floor : floors)
      if (floor <= height) below = floor;
    return below;
  }
};

bool is_standing(SemanticClass label, float above_lowest_m) {
  if (label == SemanticClass::unlabeled) return above_lowest_m > standing_height_m;
  return !is_ground(label) && !is_movable(label);
}

TileContent content_of(const Tile& tile, const LayeredCells& coarse, bool has_storeys) {
  std::map<std::uint64_t, Cell> cells;
  const auto key_of = [&](const Eigen::Vector3f& p) {
    return cell_key(coarse.index(static_cast<double>(p.x())),
                    coarse.index(static_cast<double>(p.y())));
  };
  for (const Voxel& voxel : tile.voxels) {
    const float z = voxel.mean_map.z();
    Cell& cell = cells.try_emplace(key_of(voxel.mean_map), Cell{z, std::nullopt}).first->second;
    cell.lowest = std::min(cell.lowest, z);
    const bool is_on_ground = is_ground(voxel.evidence.winner());
    if (is_on_ground) cell.ground = std::min(cell.ground.value_or(z), z);
    if (has_storeys) cell.heights.push_back(z);
    if (has_storeys && is_on_ground) cell.ground_heights.push_back(z);
  }
  TileContent content;
  std::map<std::uint64_t, std::vector<float>> floors;
  for (auto& [key, cell] : cells)
    if (has_storeys) floors[key] = Cell::floors_of(cell.heights);
  bool is_labelled = false;
  for (const Voxel& voxel : tile.voxels) {
    const SemanticClass label = voxel.evidence.winner();
    is_labelled |= label != SemanticClass::unlabeled;
    const std::uint64_t key = key_of(voxel.mean_map);
    const float z = voxel.mean_map.z();
    if (is_standing(label, z - cells.at(key).floor_below(floors[key], z)))
      content.standing_map.push_back(voxel.mean_map);
  }
  for (auto& [key, cell] : cells) {
    if (!cell.ground && is_labelled) continue;
    content.floors[key] = {cell.ground.value_or(cell.lowest)};
    if (has_storeys)
      content.floors[key] = cell.ground ? Cell::floors_of(cell.ground_heights) : floors[key];
  }
  return content;
}

/// Whether the path leads over itself, by a bridge or in a car park.
bool leads_over_itself(const SharedTrajectory& trajectory) {
  struct Heights {
    float low = 0.0F, high = 0.0F;
  };
  tsl::robin_map<std::uint64_t, Heights, IndexHash> of_cell;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d p = pose.T_map_lidar.translation();
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > VoxelGrid::max_coordinate_m) continue;
    const auto z = static_cast<float>(p.z());
    const std::uint64_t key = cell_key(static_cast<int>(std::floor(p.x() / storey_cell_m)),
                                       static_cast<int>(std::floor(p.y() / storey_cell_m)));
    const auto entry = of_cell.try_emplace(key, Heights{z, z}).first;
    Heights& heights = entry.value();
    heights = {std::min(heights.low, z), std::max(heights.high, z)};
    if (heights.high - heights.low > min_storey_height_m) return true;
  }
  return false;
}

}  // namespace

PlaceIndex::PlaceIndex(std::shared_ptr<const MapSnapshot> map, const SharedTrajectory& trajectory,
                       std::shared_ptr<TileReader> tiles, const PlaceIndexConfig& config)
    : map_(std::move(map)),
      tiles_(std::move(tiles)),
      config_(config),
      coarse_(config.coarse),
      fine_(config.fine) {
  has_storeys_ = leads_over_itself(trajectory);
  const Floors floors = fill_cells();
  place_nodes(trajectory, floors);
  place_blocks();
}

PlaceIndex::Floors PlaceIndex::fill_cells() {
  Floors floors;
  std::atomic<std::size_t> unread = 0;
  const std::vector<TileTable::SharedTile> all(map_->tiles.begin(), map_->tiles.end());
  // A few at a time: those that are on disk need not be in memory together.
  constexpr std::size_t portion = 64;
  for (std::size_t begin = 0; begin < all.size(); begin += portion) {
    std::vector<TileContent> contents(std::min(portion, all.size() - begin));
    tbb::parallel_for(std::size_t{0}, contents.size(), [&](std::size_t k) {
      if (const auto tile = readable(all[begin + k]))
        contents[k] = content_of(*tile, coarse_, has_storeys_);
      else
        ++unread;
    });
    for (const TileContent& content : contents) {
      for (const Eigen::Vector3f& p_map : content.standing_map) {
        coarse_.insert(p_map);
        fine_.insert(p_map);
      }
      for (const auto& [key, heights] : content.floors) {
        const auto [entry, is_new] = floors.lowest.try_emplace(key, heights.front());
        if (!is_new) entry.value() = std::min(entry->second, heights.front());
        if (heights.size() > 1) floors.higher[key].assign(heights.begin() + 1, heights.end());
      }
    }
  }
  unread_tiles_ = unread;
  return floors;
}

std::shared_ptr<const Tile> PlaceIndex::readable(const TileTable::SharedTile& tile) const {
  try {
    return tiles_->read(tile);
  } catch (const TileChanged&) {
    throw;
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

void PlaceIndex::place_nodes(const SharedTrajectory& trajectory, const Floors& floors) {
  if (trajectory.empty()) return place_nodes_on_ground(floors);
  tsl::robin_map<std::uint64_t, std::vector<float>, IndexHash> taken;
  std::vector<float> path_heights_m;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d p = pose.T_map_lidar.translation();
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > VoxelGrid::max_coordinate_m) continue;
    const auto index = [&](double m) {
      return static_cast<int>(std::floor(m / config_.node_spacing_m));
    };
    const auto height = static_cast<float>(p.z());
    std::vector<float>& heights = taken[cell_key(index(p.x()), index(p.y()))];
    const bool is_taken = std::ranges::any_of(heights, [&](float known) {
      return !has_storeys_ || std::abs(known - height) < min_storey_height_m;
    });
    if (is_taken) continue;
    heights.push_back(height);
    nodes_.push_back({p.head<2>(), {}, 0.0});
    path_heights_m.push_back(height);
  }
  fit_ground(floors, path_heights_m);
}

void PlaceIndex::place_nodes_on_ground(const Floors& floors) {
  std::vector<float> path_heights_m;
  const int step = std::max(1, static_cast<int>(config_.node_spacing_m / config_.coarse.cell_m));
  for (const auto& [key, height] : floors.lowest) {
    const auto [x, y, z] = unpacked_index(key);
    if (x % step != 0 || y % step != 0) continue;
    nodes_.push_back({config_.coarse.cell_m * Eigen::Vector2d(x + 0.5, y + 0.5), {}, 0.0});
    path_heights_m.push_back(height + static_cast<float>(usual_body_height_m));
  }
  fit_ground(floors, path_heights_m);
}

std::optional<float> PlaceIndex::Floors::below(std::uint64_t cell, float path_height_m) const {
  const auto entry = lowest.find(cell);
  if (entry == lowest.end()) return std::nullopt;
  float ground_m = entry->second;
  if (const auto above = higher.find(cell); above != higher.end()) {
    for (const float floor_m : above->second)
      if (floor_m - path_height_m <= max_ground_above_m) ground_m = floor_m;
  }
  const float below_m = path_height_m - ground_m;
  if (below_m > max_ground_below_m || below_m < -max_ground_above_m) return std::nullopt;
  return ground_m;
}

void PlaceIndex::fit_ground(const Floors& floors, const std::vector<float>& path_heights_m) {
  std::vector<std::uint8_t> is_fitted(nodes_.size(), 0);
  const int radius = static_cast<int>(ground_radius_m / config_.coarse.cell_m);
  tbb::parallel_for(std::size_t{0}, nodes_.size(), [&](std::size_t k) {
    const Eigen::Vector2d& position_map = nodes_[k].position_map;
    const int node_x = coarse_.index(position_map.x());
    const int node_y = coarse_.index(position_map.y());
    std::vector<Eigen::Vector3f> around;
    for (int y = node_y - radius; y <= node_y + radius; ++y) {
      for (int x = node_x - radius; x <= node_x + radius; ++x) {
        const auto ground_m = floors.below(cell_key(x, y), path_heights_m[k]);
        if (!ground_m) continue;
        const Eigen::Vector2d centre = config_.coarse.cell_m * Eigen::Vector2d(x + 0.5, y + 0.5);
        const Eigen::Vector2f from_node = (centre - position_map).cast<float>();
        around.emplace_back(from_node.x(), from_node.y(), *ground_m);
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
  const double usual_m = heights.empty() ? usual_body_height_m : median_of(heights);
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (is_fitted[k] != 0) continue;
    nodes_[k].ground.height_m = static_cast<double>(path_heights_m[k]) - usual_m;
    nodes_[k].body_height_m = usual_m;
  }
}

Eigen::Vector2d PlaceIndex::middle_of(const Block& block) const {
  return config_.coarse.cell_m *
         Eigen::Vector2d(block.first_x + 0.5 * block_width, block.first_y + 0.5 * block_height);
}

void PlaceIndex::place_blocks() {
  const double cell_m = config_.coarse.cell_m;
  const int reach = static_cast<int>(std::ceil(config_.corridor_m / cell_m));
  const auto part = [](int index, int side) {
    return static_cast<int>(std::floor(static_cast<double>(index) / side));
  };
  // By row and column, the nodes that a place of the block is near to.
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> nodes_of;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const int x = coarse_.index(nodes_[k].position_map.x());
    const int y = coarse_.index(nodes_[k].position_map.y());
    for (int row = part(y - reach, block_height); row <= part(y + reach, block_height); ++row)
      for (int column = part(x - reach, block_width); column <= part(x + reach, block_width);
           ++column)
        nodes_of[{row, column}].push_back(static_cast<std::uint32_t>(k));
  }
  for (const auto& [place, nodes] : nodes_of) {
    Block empty{place.second * block_width, place.first * block_height, {}, 0};
    empty.is_searched.assign(std::size_t{block_width} * block_height, 0);
    for (const std::vector<std::uint32_t>& storey : storeys_of(nodes, middle_of(empty)))
      place_block(empty, storey);
  }
}

std::vector<std::vector<std::uint32_t>> PlaceIndex::storeys_of(
    std::vector<std::uint32_t> nodes, const Eigen::Vector2d& middle_map) const {
  if (!has_storeys_) return {std::move(nodes)};
  const auto ground_m = [&](std::uint32_t k) {
    return nodes_[k].ground.at(middle_map - nodes_[k].position_map);
  };
  std::ranges::stable_sort(nodes, {}, ground_m);
  std::vector<std::vector<std::uint32_t>> storeys;
  for (const std::uint32_t k : nodes) {
    const bool is_above =
        storeys.empty() || ground_m(k) - ground_m(storeys.back().front()) > max_block_step_m;
    if (is_above) storeys.emplace_back();
    storeys.back().push_back(k);
  }
  return storeys;
}

void PlaceIndex::place_block(Block block, const std::vector<std::uint32_t>& nodes) {
  const double cell_m = config_.coarse.cell_m;
  const int reach = static_cast<int>(std::ceil(config_.corridor_m / cell_m));
  bool is_reached = false;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const std::uint32_t k : nodes) {
    const Eigen::Vector2d& position_map = nodes_[k].position_map;
    const int near_x = coarse_.index(position_map.x()) - block.first_x;
    const int near_y = coarse_.index(position_map.y()) - block.first_y;
    bool reaches = false;
    for (int y = std::max(0, near_y - reach); y <= std::min(block_height - 1, near_y + reach);
         ++y) {
      for (int x = std::max(0, near_x - reach); x <= std::min(block_width - 1, near_x + reach);
           ++x) {
        const Eigen::Vector2d centre =
            cell_m * Eigen::Vector2d(block.first_x + x + 0.5, block.first_y + y + 0.5);
        if ((centre - position_map).norm() > config_.corridor_m) continue;
        block.is_searched[static_cast<std::size_t>(y * block_width + x)] = 1;
        reaches = true;
      }
    }
    is_reached |= reaches;
    const double distance_m = (middle_of(block) - position_map).norm();
    if (!reaches || distance_m >= nearest_m) continue;
    nearest_m = distance_m;
    block.node = k;
  }
  if (is_reached) blocks_.push_back(std::move(block));
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
    const auto tile = readable(near[k]);
    if (tile == nullptr) return;
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

double PlaceIndex::body_height_m(const Eigen::Vector2d& position_map) const {
  const auto nearest = std::ranges::min_element(nodes_, {}, [&](const PathNode& node) {
    return (node.position_map - position_map).squaredNorm();
  });
  return nearest == nodes_.end() ? usual_body_height_m : nearest->body_height_m;
}

std::vector<double> PlaceIndex::floors_near(const Eigen::Vector2d& position_map,
                                            double radius_m) const {
  std::vector<double> heights_m;
  for (const PathNode& node : nodes_)
    if ((node.position_map - position_map).norm() < radius_m)
      heights_m.push_back(node.ground.at(position_map - node.position_map));
  std::ranges::sort(heights_m);
  std::vector<double> floors_m;
  for (const double height_m : heights_m)
    if (floors_m.empty() || height_m - floors_m.back() > min_floor_step_m)
      floors_m.push_back(height_m);
  return floors_m;
}

std::size_t PlaceIndex::memory_bytes() const {
  return coarse_.memory_bytes() + fine_.memory_bytes() + nodes_.capacity() * sizeof(PathNode) +
         blocks_.size() * (sizeof(Block) + std::size_t{block_width} * block_height);
}

}  // namespace stillmap
