#include "core/map/scan_sorter.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <numeric>

namespace stillmap {
namespace {

constexpr std::uint32_t no_tile = std::numeric_limits<std::uint32_t>::max();

float confidence(const PointLabels& labels, std::size_t i) {
  return labels.confidence.empty() ? 1.0F : labels.confidence[i];
}

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
  if (!grid_.holds(lidar_map)) return {};
  const TileId centre = grid_.index(lidar_map).tile;
  const Window window{{centre.x - reach_tiles_, centre.y - reach_tiles_}, 2 * reach_tiles_ + 1};
  index_points(scan, T_map_lidar, window);
  for (std::size_t i = 0; i < is_thin.size(); ++i) placed_[i].is_thin = is_thin[i] != 0;
  group_by_tile(window);
  return batches_;
}

ScanSorter::PoseInVoxels::PoseInVoxels(const Eigen::Isometry3d& T_map_lidar, double voxel_size_m) {
  const Eigen::Matrix4d in_voxels = T_map_lidar.matrix() / voxel_size_m;
  x = in_voxels.col(0);
  y = in_voxels.col(1);
  z = in_voxels.col(2);
  origin = in_voxels.col(3);
  for (Eigen::Array4d* const column : {&x, &y, &z, &origin}) (*column)[3] = 0.0;
}

void ScanSorter::index_points(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                              const Window& window) {
  window_indices_.resize(scan.scan.size());
  placed_.resize(scan.scan.size());
  const PoseInVoxels pose(T_map_lidar, grid_.voxel_size_m());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.scan.size(), 4096),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i != range.end(); ++i)
                        index_point(i, scan, pose, window);
                    });
}

void ScanSorter::index_point(std::size_t i, const LabelledScan& scan, const PoseInVoxels& pose,
                             const Window& window) {
  constexpr double steps = PackedVoxel::offset_steps;
  window_indices_[i] = no_tile;
  const Eigen::Vector3d p = scan.scan.points_lidar[i].cast<double>();
  // Written so that NaN fails.
  if (!(p.squaredNorm() <= max_range_m_ * max_range_m_)) return;
  const Eigen::Array4d place = pose.x * p.x() + pose.y * p.y() + pose.z * p.z() + pose.origin;
  if (!grid_.holds((place.head<3>() * grid_.voxel_size_m()).matrix())) return;

  const Eigen::Array4d whole = place.floor();
  const Eigen::Array4i voxel = whole.cast<int>();
  const Eigen::Array4i offset = ((place - whole) * steps).min(steps - 1.0).cast<int>();
  // From the window's corner.
  const auto columns = static_cast<std::uint32_t>(grid_.columns());
  const auto x = static_cast<std::uint32_t>(voxel[0] - window.first.x * grid_.columns());
  const auto y = static_cast<std::uint32_t>(voxel[1] - window.first.y * grid_.columns());
  const std::uint32_t row = x / columns;
  const std::uint32_t column = y / columns;
  // Only a transform that is not rigid moves a point out of the window.
  const auto side = static_cast<std::uint32_t>(window.side);
  if (row >= side || column >= side) return;
  window_indices_[i] = row * side + column;
  placed_[i] = {voxel_key({static_cast<std::uint16_t>(x - row * columns),
                           static_cast<std::uint16_t>(y - column * columns),
                           static_cast<std::int16_t>(voxel[2])}),
                {static_cast<std::uint8_t>(offset[0]), static_cast<std::uint8_t>(offset[1]),
                 static_cast<std::uint8_t>(offset[2])},
                scan.label(i),
                scan.motion[i],
                false,
                confidence(scan.labels, i)};
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
