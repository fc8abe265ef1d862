#include "core/odometry/feature_map.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace stillmap {
namespace {

std::uint64_t key_of(const Eigen::Vector3i& voxel) {
  return packed_index(voxel.x(), voxel.y(), voxel.z());
}

/// Voxel offsets, nearest first, so that the search radius shrinks early.
constexpr std::array<std::array<int, 3>, 27> offsets_by_distance = [] {
  std::array<std::array<int, 3>, 27> offsets{};
  std::size_t n = 0;
  for (int rank = 0; rank <= 3; ++rank)
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z)
          if (x * x + y * y + z * z == rank) offsets[n++] = {x, y, z};
  return offsets;
}();

/// Keeps `neighbours` sorted and at most n long.
void insert_sorted(Neighbours& neighbours, int n, const LabelledPoint& point,
                   float squared_distance) {
  int place = neighbours.count < n ? neighbours.count++ : n - 1;
  for (; place > 0; --place) {
    const auto k = static_cast<std::size_t>(place);
    if (neighbours.squared_distance[k - 1] <= squared_distance) break;
    neighbours.squared_distance[k] = neighbours.squared_distance[k - 1];
    neighbours.points[k] = neighbours.points[k - 1];
  }
  neighbours.squared_distance[static_cast<std::size_t>(place)] = squared_distance;
  neighbours.points[static_cast<std::size_t>(place)] = point;
}

}  // namespace

void FeatureMap::Block::push(const LabelledPoint& point) {
  const auto k = static_cast<std::size_t>(count++);
  x[k] = point.position_map.x();
  y[k] = point.position_map.y();
  z[k] = point.position_map.z();
  label[k] = point.label;
  movable += is_movable(point.label) ? 1 : 0;
}

void FeatureMap::Block::remove(int i) {
  const auto k = static_cast<std::size_t>(i);
  const auto last = static_cast<std::size_t>(--count);
  movable -= is_movable(label[k]) ? 1 : 0;
  x[k] = x[last];
  y[k] = y[last];
  z[k] = z[last];
  label[k] = label[last];
}

FeatureMap::FeatureMap(const LocalMapConfig& config)
    : max_points_(std::min(config.max_points_per_voxel, block_capacity)),
      voxel_size_m_(static_cast<float>(config.voxel_size_m)),
      min_spacing_m_(static_cast<float>(config.min_spacing_m)),
      radius_m_(static_cast<float>(config.radius_m)) {}

Eigen::Vector3i FeatureMap::voxel_of(const Eigen::Vector3f& position_map) const {
  return (position_map / voxel_size_m_).array().floor().cast<int>();
}

void FeatureMap::insert(std::span<const LabelledPoint> points) {
  for (const LabelledPoint& point : points) insert(point);
}

FeatureMap::Block& FeatureMap::block_at(std::uint64_t key) {
  const auto [entry, is_new] = index_.try_emplace(key, 0U);
  if (!is_new) return blocks_[entry->second];
  if (free_blocks_.empty()) {
    free_blocks_.push_back(static_cast<std::uint32_t>(blocks_.size()));
    blocks_.emplace_back();
  }
  entry.value() = free_blocks_.back();
  free_blocks_.pop_back();
  return blocks_[entry->second];
}

void FeatureMap::insert(const LabelledPoint& point) {
  Block& block = block_at(key_of(voxel_of(point.position_map)));
  if (block.count >= max_points_) return;
  for (int i = 0; i < block.count; ++i) {
    if ((block.position(i) - point.position_map).squaredNorm() < min_spacing_m_ * min_spacing_m_)
      return;
  }
  block.push(point);
  ++size_;
}

Neighbours FeatureMap::nearest(const Eigen::Vector3f& position_map, int n,
                               float max_distance_m) const {
  assert(n >= 1 && n <= Neighbours::capacity && max_distance_m <= voxel_size_m_ * 1.0001F);
  Neighbours found;
  float limit = max_distance_m * max_distance_m;
  const Eigen::Vector3i centre = voxel_of(position_map);
  // Distance from the point to the voxel's lower and upper faces.
  const Eigen::Array3f below = position_map.array() - centre.cast<float>().array() * voxel_size_m_;
  const Eigen::Array3f above = voxel_size_m_ - below;
  for (const auto& offset : offsets_by_distance) {
    float to_voxel = 0.0F;
    for (int axis = 0; axis < 3; ++axis) {
      const int step = offset[static_cast<std::size_t>(axis)];
      const float gap = step == 0 ? 0.0F : (step < 0 ? below[axis] : above[axis]);
      to_voxel += gap * gap;
    }
    if (to_voxel > limit) continue;
    const auto entry =
        index_.find(key_of(centre + Eigen::Vector3i(offset[0], offset[1], offset[2])));
    if (entry == index_.end()) continue;
    const Block& block = blocks_[entry->second];
    std::array<float, block_capacity> squared;
    const auto count = static_cast<std::size_t>(block.count);
    for (std::size_t i = 0; i < count; ++i) {
      const float dx = block.x[i] - position_map.x();
      const float dy = block.y[i] - position_map.y();
      const float dz = block.z[i] - position_map.z();
      squared[i] = dx * dx + dy * dy + dz * dz;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (squared[i] > limit) continue;
      insert_sorted(found, n, {block.position(static_cast<int>(i)), block.label[i]}, squared[i]);
      if (found.count == n) limit = found.squared_distance[static_cast<std::size_t>(n - 1)];
    }
  }
  return found;
}

void FeatureMap::remove_far_from(const Eigen::Vector3f& centre_map) {
  if (kept_round_map_ && (centre_map - *kept_round_map_).norm() < 0.02F * radius_m_) return;
  kept_round_map_ = centre_map;
  for (auto entry = index_.begin(); entry != index_.end();) {
    Block& block = blocks_[entry->second];
    if (block.count > 0 &&
        (block.position(0) - centre_map).squaredNorm() <= radius_m_ * radius_m_) {
      ++entry;
      continue;
    }
    size_ -= static_cast<std::size_t>(block.count);
    block = Block{};
    free_blocks_.push_back(entry->second);
    entry = index_.erase(entry);
  }
}

std::vector<LabelledPoint> FeatureMap::points() const {
  std::vector<LabelledPoint> all;
  all.reserve(size_);
  for (const Block& block : blocks_)
    for (int i = 0; i < block.count; ++i)
      all.push_back({block.position(i), block.label[static_cast<std::size_t>(i)]});
  return all;
}

void FeatureMap::clear() {
  index_.clear();
  blocks_.clear();
  free_blocks_.clear();
  size_ = 0;
  kept_round_map_.reset();
}

}  // namespace stillmap
