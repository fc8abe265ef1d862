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
using Lanes = Eigen::Array<double, static_cast<int>(lanes), 1>;
using WholeLanes = Eigen::Array<int, static_cast<int>(lanes), 1>;

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
  index_points(scan, T_map_lidar, window);
  for (std::size_t i = 0; i < is_thin.size(); ++i) placed_[i].is_thin = is_thin[i] != 0;
  group_by_tile(window);
  return batches_;
}

ScanSorter::PoseInVoxels::PoseInVoxels(const Eigen::Isometry3d& T_map_lidar, double voxel_size_m) {
  const Eigen::Matrix<double, 3, 4> in_voxels = T_map_lidar.affine() / voxel_size_m;
  x = in_voxels.col(0);
  y = in_voxels.col(1);
  z = in_voxels.col(2);
  origin = in_voxels.col(3);
}

/// Where some points lie: the place of their tile in the window, or `no_tile`, their voxel in it,
/// and how far they are from its lowest corner, in parts of it. Without branches.
struct ScanSorter::LanesPlaced {
  LanesPlaced(std::span<const Eigen::Vector3f> points_lidar, const PoseInVoxels& pose,
              const Window& window, const VoxelGrid& grid, double max_range_m) {
    Lanes p_x = Lanes::Zero(), p_y = Lanes::Zero(), p_z = Lanes::Zero();
    for (std::size_t k = 0; k < points_lidar.size(); ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      p_x[lane] = points_lidar[k].x();
      p_y[lane] = points_lidar[k].y();
      p_z[lane] = points_lidar[k].z();
    }
    const Lanes squared_m2 = p_x * p_x + (p_y * p_y + p_z * p_z);
    const double max_squared_m2 = max_range_m * max_range_m;
    for (Eigen::Index lane = 0; lane < p_x.size(); ++lane) {
      // NaN, too: what no whole number holds must not be cast to one.
      const bool is_far = !(squared_m2[lane] <= max_squared_m2);
      p_x[lane] = is_far ? 0.0 : p_x[lane];
      p_y[lane] = is_far ? 0.0 : p_y[lane];
      p_z[lane] = is_far ? 0.0 : p_z[lane];
    }
    constexpr double steps = PackedVoxel::offset_steps;
    std::array<Lanes, 3> place, whole;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      place[axis] = pose.x[a] * p_x + pose.y[a] * p_y + pose.z[a] * p_z + pose.origin[a];
      whole[axis] = place[axis].floor();
      offset[axis] = ((place[axis] - whole[axis]) * steps).min(steps - 1.0).cast<int>();
    }
    // From the window's corner. Half a voxel from a tile's border rounding cannot cross it.
    const double columns = grid.columns();
    const Lanes x = whole[0] - columns * window.first.x;
    const Lanes y = whole[1] - columns * window.first.y;
    const Lanes row = ((x + 0.5) * (1.0 / columns)).floor();
    const Lanes column = ((y + 0.5) * (1.0 / columns)).floor();
    const WholeLanes place_in_window = (row * window.side + column).cast<int>();
    const WholeLanes voxel_x = (x - row * columns).cast<int>();
    const WholeLanes voxel_y = (y - column * columns).cast<int>();
    const WholeLanes voxel_z = whole[2].cast<int>();
    for (std::size_t k = 0; k < lanes; ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      const Eigen::Vector3d in_voxels(place[0][lane], place[1][lane], place[2][lane]);
      // Only a transform that is not quite rigid moves a point out of the window.
      const bool is_mapped = (squared_m2[lane] <= max_squared_m2) & (row[lane] >= 0.0) &
                             (row[lane] < window.side) & (column[lane] >= 0.0) &
                             (column[lane] < window.side) &
                             grid.holds(in_voxels * grid.voxel_size_m());
      tile[k] = is_mapped ? static_cast<std::uint32_t>(place_in_window[lane]) : no_tile;
      voxel_key[k] = stillmap::voxel_key({static_cast<std::uint16_t>(voxel_x[lane]),
                                          static_cast<std::uint16_t>(voxel_y[lane]),
                                          static_cast<std::int16_t>(voxel_z[lane])});
    }
  }

  std::array<std::uint32_t, lanes> tile, voxel_key;
  std::array<WholeLanes, 3> offset;
};

void ScanSorter::index_points(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                              const Window& window) {
  window_indices_.resize(scan.scan.size());
  placed_.resize(scan.scan.size());
  const PoseInVoxels pose(T_map_lidar, grid_.voxel_size_m());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.scan.size(), 4096),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); i += lanes)
                        index_some(i, std::min(lanes, range.end() - i), scan, pose, window);
                    });
}

void ScanSorter::index_some(std::size_t first, std::size_t count, const LabelledScan& scan,
                            const PoseInVoxels& pose, const Window& window) {
  const LanesPlaced placed(std::span(scan.scan.points_lidar).subspan(first, count), pose, window,
                           grid_, max_range_m_);
  std::ranges::copy_n(placed.tile.begin(), static_cast<std::ptrdiff_t>(count),
                      window_indices_.begin() + static_cast<std::ptrdiff_t>(first));
  const auto points = std::span(placed_).subspan(first, count);
  const auto motion = std::span(scan.motion).subspan(first, count);
  const bool has_labels = !scan.labels.empty();
  const bool has_confidence = !scan.labels.confidence.empty();
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = first + k;
    const auto lane = static_cast<Eigen::Index>(k);
    points[k] = {placed.voxel_key[k],
                 {static_cast<std::uint8_t>(placed.offset[0][lane]),
                  static_cast<std::uint8_t>(placed.offset[1][lane]),
                  static_cast<std::uint8_t>(placed.offset[2][lane])},
                 has_labels ? scan.labels.classes[i] : SemanticClass::unlabeled,
                 motion[k],
                 false,
                 has_confidence ? scan.labels.confidence[i] : 1.0F};
  }
}

void ScanSorter::group_by_tile(const Window& window) {
  // Counting sort: stable, so that a tile sees its points in the order of the scan.
  begins_.assign(static_cast<std::size_t>(window.side) * static_cast<std::size_t>(window.side) + 1,
                 0);
  for (const std::uint32_t place : window_indices_) {
    if (place != no_tile) ++begins_[place + 1];
  }
  std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
  grouped_.resize(begins_.back());
  for (std::size_t i = 0; i < window_indices_.size(); ++i) {
    if (window_indices_[i] != no_tile) grouped_[begins_[window_indices_[i]]++] = placed_[i];
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
