#include "core/map/query/coarse_cells.hpp"

#include <tsl/robin_map.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

/// 24 bits of x, 24 of y, 16 of z: what the map's extent divided by its finest voxel needs
/// (voxel_grid.hpp).
std::uint64_t cell_key(const Eigen::Vector3d& cell) {
  constexpr std::int64_t bias_xy = 1 << 23;
  constexpr std::int64_t bias_z = 1 << 15;
  const auto part = [](double index, std::int64_t bias) {
    const double highest = static_cast<double>(bias) - 1.0;
    return static_cast<std::uint64_t>(
        static_cast<std::int64_t>(std::clamp(index, -highest, highest)) + bias);
  };
  return part(cell.x(), bias_xy) << 40 | part(cell.y(), bias_xy) << 16 | part(cell.z(), bias_z);
}

struct Cell {
  std::uint64_t key = 0;
  std::uint64_t point_count = 0;
  Eigen::Vector3d weighted_sum = Eigen::Vector3d::Zero();
  std::array<float, semantic_class_count> evidence{};
};

QueryVoxel query_voxel(const Cell& cell) {
  const auto best = std::ranges::max_element(cell.evidence);
  float total = 0.0F;
  for (const float weight : cell.evidence) total += weight;
  QueryVoxel voxel;
  voxel.position_map = (cell.weighted_sum / static_cast<double>(cell.point_count)).cast<float>();
  if (total > 0.0F) {
    voxel.label = static_cast<SemanticClass>(best - cell.evidence.begin());
    voxel.confidence = *best / total;
  }
  voxel.point_count = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(cell.point_count, std::numeric_limits<std::uint32_t>::max()));
  return voxel;
}

}  // namespace

struct CoarseCells::State {
  double resolution_m = 0.0;
  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> position;
  std::vector<Cell> cells;
  /// Of the last voxel; voxels beside each other mostly come one after the other.
  std::uint32_t last = 0;

  Cell& cell_at(std::uint64_t key) {
    if (!cells.empty() && cells[last].key == key) return cells[last];
    const auto [slot, is_new] = position.try_emplace(key, static_cast<std::uint32_t>(cells.size()));
    if (is_new) cells.emplace_back().key = key;
    last = slot->second;
    return cells[last];
  }
};

CoarseCells::CoarseCells(double resolution_m, std::size_t expected)
    : state_(std::make_unique<State>()) {
  state_->resolution_m = resolution_m;
  state_->position.reserve(expected);
  state_->cells.reserve(expected);
}
CoarseCells::~CoarseCells() = default;

void CoarseCells::add(const Eigen::Vector3f& mean_map, std::uint32_t point_count,
                      const ClassEvidence& evidence) {
  const Eigen::Vector3d mean = mean_map.cast<double>();
  Cell& cell = state_->cell_at(cell_key((mean / state_->resolution_m).array().floor()));
  cell.point_count += point_count;
  cell.weighted_sum += mean * point_count;
  for (const auto& vote : evidence.votes()) {
    if (vote.weight > 0.0F) cell.evidence.at(static_cast<std::size_t>(vote.label)) += vote.weight;
  }
}

std::vector<QueryVoxel> CoarseCells::sorted() const {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(state_->position.begin(),
                                                             state_->position.end());
  std::ranges::sort(order);
  std::vector<QueryVoxel> voxels;
  voxels.reserve(order.size());
  for (const auto& [key, position] : order) voxels.push_back(query_voxel(state_->cells[position]));
  return voxels;
}

}  // namespace stillmap
