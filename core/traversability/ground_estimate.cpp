#include "core/traversability/ground_estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
/// Edge of the blocks of the coarse ground level [m].
constexpr double block_m = 2.0;
/// Band around the level for ground of a ground class: below it for falling terrain, above it for
/// banks and walls, but below bridges and canopies [m].
constexpr float labelled_below_m = 1.5F;
constexpr float labelled_above_m = 2.5F;
/// Band for unlabelled ground: a car's bonnet must lie outside [m].
constexpr float unlabelled_off_m = 0.5F;
/// Thickness of a surface above its lowest voxel [m].
constexpr float labelled_run_m = 0.30F;
constexpr float unlabelled_run_m = 0.15F;
/// Height of what stands up, and largest distance of the voxels that make it up [m].
constexpr float standing_m = 0.5F;
constexpr float standing_gap_m = 0.45F;
/// What goes on from ground is ground, however far from the level: farthest neighbour [cells], and
/// largest difference of the heights: constant [m] and per metre.
constexpr int going_on_cells = 2;
constexpr float going_on_m = 0.04F;
constexpr float going_on_slope = 0.35F;
/// Neighbours that it goes on from.
constexpr int min_going_on = 5;
/// Largest deviation of ground from the median of its neighbours [m].
constexpr float outlier_m = 0.4F;

bool is_ground_voxel(const ColumnVoxel& voxel) { return is_ground(voxel.label); }
bool is_unlabelled_voxel(const ColumnVoxel& voxel) {
  return voxel.label == SemanticClass::unlabeled;
}

/// The lowest voxel that can be ground.
const ColumnVoxel* lowest_candidate(Column column) {
  const auto ground = std::ranges::find_if(column, is_ground_voxel);
  if (ground != column.end()) return &*ground;
  if (!column.empty() && is_unlabelled_voxel(column.front())) return &column.front();
  return nullptr;
}

/// Whether an unlabelled column stands up from its lowest voxel, as a wall or a post does. That
/// voxel then holds the foot of it beside the ground, and lies higher than the ground.
bool stands_up(Column column) {
  float top_m = column.front().height_m;
  for (const ColumnVoxel& voxel : column.subspan(1)) {
    if (voxel.height_m - top_m > standing_gap_m) break;
    top_m = voxel.height_m;
  }
  return top_m - column.front().height_m > standing_m;
}

float low_percentile(std::vector<float>& heights_m) {
  if (heights_m.empty()) return nan;
  // 10th percentile: reflections put single voxels below the ground.
  return ranked_value(heights_m, heights_m.size() / 10);
}

float block_level(const ColumnGrid& columns, int x0, int y0, int size) {
  std::vector<float> labelled_m;
  std::vector<float> unlabelled_m;
  for (int y = y0; y < std::min(y0 + size, columns.height()); ++y) {
    for (int x = x0; x < std::min(x0 + size, columns.width()); ++x) {
      const ColumnVoxel* candidate = lowest_candidate(columns(x, y));
      if (candidate == nullptr) continue;
      (is_ground_voxel(*candidate) ? labelled_m : unlabelled_m).push_back(candidate->height_m);
    }
  }
  return low_percentile(labelled_m.empty() ? unlabelled_m : labelled_m);
}

/// Median of the neighbouring blocks, against blocks that hold only a canopy.
float median_around(const CellGrid<float>& blocks_m, int x0, int y0) {
  std::array<float, 9> heights_m{};
  std::size_t count = 0;
  for (int y = std::max(0, y0 - 1); y <= std::min(y0 + 1, blocks_m.height() - 1); ++y) {
    for (int x = std::max(0, x0 - 1); x <= std::min(x0 + 1, blocks_m.width() - 1); ++x) {
      if (!std::isnan(blocks_m(x, y))) heights_m.at(count++) = blocks_m(x, y);
    }
  }
  if (count == 0) return nan;
  return ranked_value(std::span(heights_m).first(count), (count - 1) / 2);
}

/// The surface that begins with the voxel at `first`.
template <typename Belongs>
GroundCell surface_from(Column column, std::size_t first, float run_m, const Belongs& belongs) {
  double weighted_m = 0.0;
  double weight = 0.0;
  const float lowest_m = column[first].height_m;
  GroundCell cell;
  for (const ColumnVoxel& voxel : column.subspan(first)) {
    if (voxel.height_m - lowest_m > run_m) break;
    if (!belongs(voxel)) continue;
    weighted_m += static_cast<double>(voxel.points) * voxel.height_m;
    weight += static_cast<double>(voxel.points);
    cell.top_m = voxel.height_m;
  }
  cell.height_m = weight > 0.0 ? static_cast<float>(weighted_m / weight) : lowest_m;
  cell.top_m = std::max(cell.top_m, cell.height_m);
  cell.label = column[first].label;
  cell.origin = GroundOrigin::seen;
  return cell;
}

/// The surface of an unlabelled column that is ground if it goes on from ground beside it.
GroundCell unlabelled_surface(Column column) {
  if (column.empty() || !is_unlabelled_voxel(column.front()) || stands_up(column)) return {};
  if (std::ranges::any_of(column, is_ground_voxel)) return {};
  return surface_from(column, 0, unlabelled_run_m, is_unlabelled_voxel);
}

GroundCell ground_of(Column column, float level_m) {
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (!is_ground_voxel(column[i])) continue;
    const float above_m = column[i].height_m - level_m;
    if (above_m < -labelled_below_m) continue;
    if (above_m > labelled_above_m) return {};
    return surface_from(column, i, labelled_run_m, is_ground_voxel);
  }
  if (column.empty() || !is_unlabelled_voxel(column.front())) return {};
  if (!(std::abs(column.front().height_m - level_m) <= unlabelled_off_m)) return {};
  if (stands_up(column)) return {};
  return surface_from(column, 0, unlabelled_run_m, is_unlabelled_voxel);
}

/// Whether a cell deviates from the median of the measured ground within two cells.
bool is_outlier(const GroundGrid& ground, int x0, int y0) {
  const float here_m = ground(x0, y0).height_m;
  std::array<float, 25> heights_m{};
  std::size_t count = 0;
  float farthest_m = 0.0F;
  for (int y = std::max(0, y0 - 2); y <= std::min(y0 + 2, ground.height() - 1); ++y) {
    for (int x = std::max(0, x0 - 2); x <= std::min(x0 + 2, ground.width() - 1); ++x) {
      if (ground(x, y).origin != GroundOrigin::seen) continue;
      heights_m.at(count++) = ground(x, y).height_m;
      farthest_m = std::max(farthest_m, std::abs(ground(x, y).height_m - here_m));
    }
  }
  constexpr std::size_t enough = 5;
  if (count < enough || farthest_m <= outlier_m) return false;
  return std::abs(here_m - median_of(std::span(heights_m).first(count))) > outlier_m;
}

GroundGrid without_outliers(const GroundGrid& ground) {
  GroundGrid kept = ground;
  for_each_cell(ground, [&](int x, int y) {
    if (ground(x, y).origin == GroundOrigin::seen && is_outlier(ground, x, y)) kept(x, y) = {};
  });
  return kept;
}

/// Majority class of the cell and its neighbours; its own class in a tie.
SemanticClass smoothed_label(const GroundGrid& ground, int x0, int y0) {
  std::array<int, semantic_class_count> votes{};
  for (int y = std::max(0, y0 - 1); y <= std::min(y0 + 1, ground.height() - 1); ++y) {
    for (int x = std::max(0, x0 - 1); x <= std::min(x0 + 1, ground.width() - 1); ++x) {
      if (ground(x, y).origin == GroundOrigin::seen) {
        ++votes.at(static_cast<std::size_t>(ground(x, y).label));
      }
    }
  }
  SemanticClass winner = ground(x0, y0).label;
  for (std::size_t i = 0; i < votes.size(); ++i) {
    if (votes.at(i) > votes.at(static_cast<std::size_t>(winner))) {
      winner = static_cast<SemanticClass>(i);
    }
  }
  return winner;
}

/// Ground round a cell that `surface` goes on from.
int going_on_from(const GroundGrid& ground, int x0, int y0, const GroundCell& surface,
                  double cell_m) {
  int count = 0;
  for (int dy = -going_on_cells; dy <= going_on_cells; ++dy) {
    for (int dx = -going_on_cells; dx <= going_on_cells; ++dx) {
      if (!ground.contains(x0 + dx, y0 + dy)) continue;
      const GroundCell& beside = ground(x0 + dx, y0 + dy);
      if (beside.origin != GroundOrigin::seen) continue;
      const float off_m = std::abs(surface.height_m - beside.height_m);
      const auto distance_m = static_cast<float>(cell_m * std::sqrt(dx * dx + dy * dy));
      if (off_m <= going_on_m + going_on_slope * distance_m) ++count;
    }
  }
  return count;
}

/// Adds unlabelled surfaces that go on from ground, cell by cell: a ramp and where it leads to,
/// which may be narrower than the level's blocks.
void add_ground_going_on(GroundGrid& ground, const ColumnGrid& columns, double cell_m) {
  CellGrid<GroundCell> surfaces(columns.width(), columns.height());
  std::vector<std::pair<int, int>> open;
  for_each_cell(columns, [&](int x, int y) {
    if (ground(x, y).origin == GroundOrigin::seen) return;
    surfaces(x, y) = unlabelled_surface(columns(x, y));
    if (surfaces(x, y).origin == GroundOrigin::seen) open.emplace_back(x, y);
  });
  while (!open.empty()) {
    const auto [x, y] = open.back();
    open.pop_back();
    if (ground(x, y).origin == GroundOrigin::seen) continue;
    if (going_on_from(ground, x, y, surfaces(x, y), cell_m) < min_going_on) continue;
    ground(x, y) = surfaces(x, y);
    for (int dy = -going_on_cells; dy <= going_on_cells; ++dy) {
      for (int dx = -going_on_cells; dx <= going_on_cells; ++dx) {
        if (ground.contains(x + dx, y + dy) &&
            ground(x + dx, y + dy).origin == GroundOrigin::none &&
            surfaces(x + dx, y + dy).origin == GroundOrigin::seen)
          open.emplace_back(x + dx, y + dy);
      }
    }
  }
}

}  // namespace

GroundLevel::GroundLevel(const ColumnGrid& columns, double cell_m)
    : cells_per_block_(std::max(1, static_cast<int>(std::lround(block_m / cell_m)))) {
  const auto blocks_along = [this](int cells) {
    return (cells + cells_per_block_ - 1) / cells_per_block_;
  };
  CellGrid<float> low_m(blocks_along(columns.width()), blocks_along(columns.height()), nan);
  for_each_cell(low_m, [&](int x, int y) {
    low_m(x, y) =
        block_level(columns, x * cells_per_block_, y * cells_per_block_, cells_per_block_);
  });
  blocks_m_ = low_m;
  for_each_cell(low_m, [&](int x, int y) { blocks_m_(x, y) = median_around(low_m, x, y); });
}

/// Interpolated between the middles of blocks: on a slope, one level for each would be far off at
/// their borders.
float GroundLevel::at(int x, int y) const {
  const auto in_blocks = [this](int cell) {
    return (static_cast<float>(cell) + 0.5F) / static_cast<float>(cells_per_block_) - 0.5F;
  };
  const float column = in_blocks(x);
  const float row = in_blocks(y);
  const int first_column = static_cast<int>(std::floor(column));
  const int first_row = static_cast<int>(std::floor(row));
  float sum_m = 0.0F;
  float weight = 0.0F;
  for (const int block_y : {first_row, first_row + 1}) {
    for (const int block_x : {first_column, first_column + 1}) {
      if (!blocks_m_.contains(block_x, block_y) || std::isnan(blocks_m_(block_x, block_y)))
        continue;
      const float share = (1.0F - std::abs(column - static_cast<float>(block_x))) *
                          (1.0F - std::abs(row - static_cast<float>(block_y)));
      sum_m += share * blocks_m_(block_x, block_y);
      weight += share;
    }
  }
  return weight > 0.0F ? sum_m / weight : nan;
}

GroundGrid seen_ground(const ColumnGrid& columns, const GroundLevel& level, double cell_m) {
  GroundGrid ground(columns.width(), columns.height());
  for_each_cell(columns, [&](int x, int y) {
    if (!columns(x, y).empty()) ground(x, y) = ground_of(columns(x, y), level.at(x, y));
  });
  GroundGrid kept = without_outliers(ground);
  add_ground_going_on(kept, columns, cell_m);
  GroundGrid smoothed = kept;
  for_each_cell(kept, [&](int x, int y) {
    if (kept(x, y).origin == GroundOrigin::seen) smoothed(x, y).label = smoothed_label(kept, x, y);
  });
  return smoothed;
}

}  // namespace stillmap
