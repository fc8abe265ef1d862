#include "core/map/scan_sorter.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace stillmap {
namespace {

constexpr std::uint32_t no_tile = std::numeric_limits<std::uint32_t>::max();

/// So many points are placed at once, in vector registers.
constexpr std::size_t lanes = 32;
using Lanes = std::array<double, lanes>;
using WholeLanes = std::array<std::int32_t, lanes>;

}  // namespace

ScanSorter::ScanSorter(const VoxelGrid& grid, double max_range_m)
    : grid_(grid),
      max_range_m_(max_range_m),
      // One more than the range needs, so that rounding at its end stays inside.
      reach_tiles_(static_cast<std::int32_t>(std::ceil(max_range_m / grid.tile_size_m())) + 1) {}

std::span<const ScanSorter::Batch> ScanSorter::sort(const LabelledScan& scan,
                                                    const Eigen::Isometry3d& T_map_lidar,
                                                    std::span<const std::uint8_t> is_thin) {
  batches_.clear();
  const Eigen::Vector3d lidar_map = T_map_lidar.translation();
  // Of a rotation the norm is the root of 3. Written so that NaN fails.
  if (!grid_.holds(lidar_map) || !(T_map_lidar.linear().norm() < 2.0)) return {};
  const TileId centre = grid_.index(lidar_map).tile;
  const Window window{{centre.x - reach_tiles_, centre.y - reach_tiles_}, 2 * reach_tiles_ + 1};
  index_points(scan.scan, T_map_lidar, window);
  group_by_tile(scan, is_thin, window);
  return batches_;
}

ScanSorter::PoseInVoxels::PoseInVoxels(const Eigen::Isometry3d& T_map_lidar, double voxel_size_m)
    : in_voxels_(T_map_lidar.affine() / voxel_size_m) {}

/// Where some points lie: the place of their tile in the window, or `no_tile`, their voxel in it,
/// and how far they are from its lowest corner, in parts of it, eight bits an axis. Loops without
/// branches, of which the compiler makes vectors.
struct ScanSorter::LanesPlaced {
  LanesPlaced(std::span<const Eigen::Vector3f> points_lidar, const PoseInVoxels& pose,
              const Window& window, const VoxelGrid& grid, double max_range_m) {
    Lanes p_x{}, p_y{}, p_z{};
    for (std::size_t k = 0; k < points_lidar.size(); ++k) {
      p_x[k] = points_lidar[k].x();
      p_y[k] = points_lidar[k].y();
      p_z[k] = points_lidar[k].z();
    }
    const double max_squared_m2 = max_range_m * max_range_m;
    std::array<double, lanes> is_near;
    for (std::size_t k = 0; k < lanes; ++k) {
      // NaN is not, either: what no whole number holds must not be cast to one.
      const double x = p_x[k], y = p_y[k], z = p_z[k];
      const bool near = x * x + (y * y + z * z) <= max_squared_m2;
      is_near[k] = near ? 1.0 : 0.0;
      p_x[k] = near ? x : 0.0;
      p_y[k] = near ? y : 0.0;
      p_z[k] = near ? z : 0.0;
    }
    const double columns = grid.columns();
    const double tiles_per_column = 1.0 / columns;
    const double max_voxels = VoxelGrid::max_coordinate_m / grid.voxel_size_m();
    const double max_layers = grid.max_z_m() / grid.voxel_size_m();
    const double first_x = columns * window.first.x, first_y = columns * window.first.y;
    const auto side = static_cast<double>(window.side);
    const double last = side - 1.0;
    for (std::size_t k = 0; k < lanes; ++k) {
      const double in_x = pose.along(0, p_x[k], p_y[k], p_z[k]);
      const double in_y = pose.along(1, p_x[k], p_y[k], p_z[k]);
      const double in_z = pose.along(2, p_x[k], p_y[k], p_z[k]);
      const double whole_x = std::floor(in_x), whole_y = std::floor(in_y);
      const double whole_z = std::floor(in_z);
      offset[k] = part(in_x - whole_x) | part(in_y - whole_y) << 8 | part(in_z - whole_z) << 16;
      // From the window's corner. Half a voxel from a tile's border rounding cannot cross it.
      const double x = whole_x - first_x, y = whole_y - first_y;
      const double row = std::floor((x + 0.5) * tiles_per_column);
      const double column = std::floor((y + 0.5) * tiles_per_column);
      // Only a transform that is not quite rigid moves a point out of the window.
      const bool is_held = (row >= 0.0) & (row <= last) & (column >= 0.0) & (column <= last) &
                           (std::abs(in_x) <= max_voxels) & (std::abs(in_y) <= max_voxels) &
                           (std::abs(in_z) <= max_layers);
      const double place = is_held & (is_near[k] > 0.0) ? row * side + column : -1.0;
      tile[k] = static_cast<std::uint32_t>(static_cast<std::int32_t>(place));
      const auto voxel_x = static_cast<std::int32_t>(x - row * columns);
      const auto voxel_y = static_cast<std::int32_t>(y - column * columns);
      const auto voxel_z = static_cast<std::int32_t>(whole_z);
      voxel_key[k] = static_cast<std::uint32_t>(voxel_x) << 24 |
                     static_cast<std::uint32_t>(voxel_y) << 16 |
                     ((static_cast<std::uint32_t>(voxel_z) & 0xFFFFU) ^ 0x8000U);
    }
  }

  static std::int32_t part(double offset) {
    constexpr double steps = PackedVoxel::offset_steps;
    return static_cast<std::int32_t>(std::min(offset * steps, steps - 1.0));
  }

  std::array<std::uint32_t, lanes> tile, voxel_key;
  WholeLanes offset;
};
static_assert(no_tile == static_cast<std::uint32_t>(-1));

void ScanSorter::index_points(const Scan& scan, const Eigen::Isometry3d& T_map_lidar,
                              const Window& window) {
  window_indices_.resize(scan.size());
  voxel_keys_.resize(scan.size());
  offsets_.resize(scan.size());
  const PoseInVoxels pose(T_map_lidar, grid_.voxel_size_m());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); i += lanes)
                        index_some(i, std::min(lanes, range.end() - i), scan, pose, window);
                    });
}

void ScanSorter::index_some(std::size_t first, std::size_t count, const Scan& scan,
                            const PoseInVoxels& pose, const Window& window) {
  const LanesPlaced placed(std::span(scan.points_lidar).subspan(first, count), pose, window, grid_,
                           max_range_m_);
  const auto take = [&](const auto& from, auto& into) {
    std::copy_n(from.begin(), count, into.begin() + static_cast<std::ptrdiff_t>(first));
  };
  take(placed.tile, window_indices_);
  take(placed.voxel_key, voxel_keys_);
  take(placed.offset, offsets_);
}

void ScanSorter::group_by_tile(const LabelledScan& scan, std::span<const std::uint8_t> is_thin,
                               const Window& window) {
  // Counting sort: stable, so that a tile sees its points in the order of the scan.
  begins_.assign(static_cast<std::size_t>(window.side) * static_cast<std::size_t>(window.side) + 1,
                 0);
  for (const std::uint32_t place : window_indices_) {
    if (place != no_tile) ++begins_[place + 1];
  }
  std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
  grouped_.resize(begins_.back());
  // By pointers of its own: a point has bytes, which as far as the compiler knows may be those of
  // anything that is reached through an object.
  const std::uint32_t* const places = window_indices_.data();
  const std::uint32_t* const keys = voxel_keys_.data();
  const std::int32_t* const offsets = offsets_.data();
  const SemanticClass* const labels = scan.labels.empty() ? nullptr : scan.labels.classes.data();
  const float* const confidence =
      scan.labels.confidence.empty() ? nullptr : scan.labels.confidence.data();
  const Motion* const motion = scan.motion.data();
  const std::uint8_t* const thin = is_thin.empty() ? nullptr : is_thin.data();
  std::uint32_t* const next = begins_.data();
  TilePoint* const grouped = grouped_.data();
  const std::size_t count = window_indices_.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (places[i] == no_tile) continue;
    const std::int32_t offset = offsets[i];
    TilePoint& point = grouped[next[places[i]]++];
    point.voxel_key = keys[i];
    point.offset = {static_cast<std::uint8_t>(offset), static_cast<std::uint8_t>(offset >> 8),
                    static_cast<std::uint8_t>(offset >> 16)};
    point.label = labels != nullptr ? labels[i] : SemanticClass::unlabeled;
    point.motion = motion[i];
    point.is_thin = thin != nullptr && thin[i] != 0;
    point.confidence = confidence != nullptr ? confidence[i] : 1.0F;
  }
  // Every begin has moved on to the end of its tile.
  std::uint32_t begin = 0;
  for (std::int32_t place = 0; place < window.side * window.side; ++place) {
    const std::uint32_t end = begins_[static_cast<std::size_t>(place)];
    if (end != begin) {
      const TileId tile{window.first.x + place / window.side, window.first.y + place % window.side};
      batches_.push_back({tile, std::span(grouped_).subspan(begin, end - begin)});
    }
    begin = end;
  }
}

}  // namespace stillmap
