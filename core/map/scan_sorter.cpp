#include "core/map/scan_sorter.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <numeric>

namespace stillmap {
namespace {

constexpr std::uint32_t no_tile = std::numeric_limits<std::uint32_t>::max();

std::uint8_t offset_step(double offset) {
  constexpr double steps = PackedVoxel::offset_steps;
  return static_cast<std::uint8_t>(std::min(offset * steps, steps - 1.0));
}

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
                                                    const Eigen::Isometry3d& T_map_lidar) {
  batches_.clear();
  const Eigen::Vector3d lidar_map = T_map_lidar.translation();
  if (!grid_.holds(lidar_map)) return {};
  const TileId centre = grid_.index(lidar_map).tile;
  const Window window{{centre.x - reach_tiles_, centre.y - reach_tiles_}, 2 * reach_tiles_ + 1};
  index_points(scan, T_map_lidar, window);
  group_by_tile(window);
  return batches_;
}

void ScanSorter::index_points(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                              const Window& window) {
  window_indices_.resize(scan.scan.size());
  placed_.resize(scan.scan.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.scan.size(), 4096),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i != range.end(); ++i) {
                        index_point(i, scan, T_map_lidar, window);
                      }
                    });
}

void ScanSorter::index_point(std::size_t i, const LabelledScan& scan,
                             const Eigen::Isometry3d& T_map_lidar, const Window& window) {
  window_indices_[i] = no_tile;
  const Eigen::Vector3d p_lidar = scan.scan.points_lidar[i].cast<double>();
  if (!(p_lidar.squaredNorm() <= max_range_m_ * max_range_m_)) return;
  const Eigen::Vector3d p_map = T_map_lidar * p_lidar;
  if (!grid_.holds(p_map)) return;

  const auto [tile, voxel, offset] = grid_.index(p_map);
  const std::int32_t row = tile.x - window.first.x;
  const std::int32_t column = tile.y - window.first.y;
  // Only a transform that is not rigid moves a point out of the window.
  if (row < 0 || row >= window.side || column < 0 || column >= window.side) return;
  window_indices_[i] = static_cast<std::uint32_t>(row * window.side + column);
  placed_[i] = {voxel_key(voxel),
                {offset_step(offset.x()), offset_step(offset.y()), offset_step(offset.z())},
                scan.label(i),
                scan.motion[i],
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
