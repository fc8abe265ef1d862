#include "core/map/query/coarse_cells.hpp"

#include <tsl/robin_map.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

using Cell3 = Eigen::Array3d;

/// The cells between two, in the order of x, then y, then z.
class CellBox {
 public:
  CellBox(const Cell3& lowest, const Cell3& highest)
      : lowest_(lowest), last_((highest - lowest).max(0.0)) {}

  [[nodiscard]] double volume() const { return (last_ + 1.0).prod(); }
  /// A cell's number in that order; of one outside, that of the nearest one inside.
  [[nodiscard]] std::uint64_t number(const Cell3& cell) const {
    const Cell3 offset = (cell - lowest_).max(0.0).min(last_);
    return static_cast<std::uint64_t>(
        (offset.x() * (last_.y() + 1.0) + offset.y()) * (last_.z() + 1.0) + offset.z());
  }

 private:
  Cell3 lowest_;
  Cell3 last_;
};

/// What cells may have at most: 24 bits of x, 24 of y, 16 of z, which the map's extent divided by
/// its finest voxel needs (voxel_grid.hpp).
Cell3 within_map(const Cell3& cell) {
  constexpr double highest_xy = (1 << 23) - 1;
  constexpr double highest_z = (1 << 15) - 1;
  const Cell3 highest(highest_xy, highest_xy, highest_z);
  return cell.max(-highest).min(highest);
}

struct Cell {
  std::uint64_t point_count = 0;
  Eigen::Vector3d weighted_sum = Eigen::Vector3d::Zero();
  Eigen::Array<float, semantic_class_count, 1> evidence =
      Eigen::Array<float, semantic_class_count, 1>::Zero();
};

QueryVoxel query_voxel(const Cell& cell) {
  Eigen::Index best = 0;
  const float most = cell.evidence.maxCoeff(&best);
  const float total = cell.evidence.sum();
  QueryVoxel voxel;
  voxel.position_map = (cell.weighted_sum / static_cast<double>(cell.point_count)).cast<float>();
  if (total > 0.0F) {
    voxel.label = static_cast<SemanticClass>(best);
    voxel.confidence = most / total;
  }
  voxel.point_count = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(cell.point_count, std::numeric_limits<std::uint32_t>::max()));
  return voxel;
}

/// So many places for each cell in a table of all that may be take less time than a hash; they take
/// 16 MB at most.
constexpr double max_places_per_cell = 64.0;
constexpr double max_places = 1 << 22;
constexpr std::uint32_t no_cell = std::numeric_limits<std::uint32_t>::max();

}  // namespace

struct CoarseCells::State {
  State(double resolution, const Eigen::AlignedBox3f& bounds_map)
      : resolution_m(resolution), box(cell_of(bounds_map.min()), cell_of(bounds_map.max())) {}

  [[nodiscard]] Cell3 cell_of(const Eigen::Vector3f& point_map) const {
    return within_map((point_map.cast<double>() / resolution_m).array().floor());
  }

  Cell& cell_at(std::uint64_t number) {
    if (!cells.empty() && number == last_number) return cells[last];
    std::uint32_t& position =
        table.empty() ? hashed.try_emplace(number, no_cell).first.value() : table[number];
    if (position == no_cell) {
      position = static_cast<std::uint32_t>(cells.size());
      cells.emplace_back();
    }
    last_number = number;
    last = position;
    return cells[last];
  }

  double resolution_m;
  CellBox box;
  std::vector<Cell> cells;
  /// Positions in `cells`, by number: of all cells of the box, or of those that there are.
  std::vector<std::uint32_t> table;
  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> hashed;
  /// Of the last voxel; voxels beside each other mostly come one after the other.
  std::uint64_t last_number = 0;
  std::uint32_t last = 0;
};

CoarseCells::CoarseCells(double resolution_m, const Eigen::AlignedBox3f& bounds_map,
                         std::size_t expected)
    : state_(std::make_unique<State>(resolution_m, bounds_map)) {
  state_->cells.reserve(expected);
  const double places = state_->box.volume();
  if (places <= std::min(max_places_per_cell * static_cast<double>(expected), max_places)) {
    state_->table.assign(static_cast<std::size_t>(places), no_cell);
  } else {
    state_->hashed.reserve(expected);
  }
}
CoarseCells::~CoarseCells() = default;

void CoarseCells::add(const Eigen::Vector3f& mean_map, std::uint32_t point_count,
                      const ClassEvidence& evidence) {
  Cell& cell = state_->cell_at(state_->box.number(state_->cell_of(mean_map)));
  cell.point_count += point_count;
  cell.weighted_sum += mean_map.cast<double>() * point_count;
  for (const auto& vote : evidence.votes()) {
    if (vote.weight > 0.0F) cell.evidence[static_cast<Eigen::Index>(vote.label)] += vote.weight;
  }
}

std::vector<QueryVoxel> CoarseCells::sorted() const {
  std::vector<QueryVoxel> voxels;
  voxels.reserve(state_->cells.size());
  for (const std::uint32_t position : state_->table) {
    if (position != no_cell) voxels.push_back(query_voxel(state_->cells[position]));
  }
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(state_->hashed.begin(),
                                                             state_->hashed.end());
  std::ranges::sort(order);
  for (const auto& [number, position] : order)
    voxels.push_back(query_voxel(state_->cells[position]));
  return voxels;
}

}  // namespace stillmap
