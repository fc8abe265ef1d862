#include "core/map/live_tile.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "core/map/tile_content.hpp"

namespace stillmap {
namespace {

constexpr double offset_steps = 1024.0;
/// The mean stands still after so many points: their sum would outgrow 32 bits.
constexpr std::uint32_t max_mean_points = 1U << 22;
constexpr int layer_bias = 1 << 15;

}  // namespace

std::uint32_t voxel_key(VoxelIndex index) {
  return std::uint32_t{index.x} << 24 | std::uint32_t{index.y} << 16 |
         static_cast<std::uint32_t>(index.z + layer_bias);
}

VoxelIndex voxel_index(std::uint32_t key) {
  return {static_cast<std::uint16_t>(key >> 24), static_cast<std::uint16_t>(key >> 16 & 0xFFU),
          static_cast<std::int16_t>(static_cast<int>(key & 0xFFFFU) - layer_bias)};
}

LiveTile::LiveTile(std::shared_ptr<const Tile> published, const VoxelGrid& grid)
    : id_(published->info.id), published_(std::move(published)) {
  voxels_.reserve(published_->voxels.size());
  for (const Voxel& known : published_->voxels) {
    LiveVoxel live{voxel_key(known.index), known.point_count,   {},
                   known.evidence,         known.first_seen_ns, known.last_seen_ns};
    const Eigen::Vector3d offset =
        (known.mean_map.cast<double>() - grid.corner_map(id_, known.index)) / grid.voxel_size_m();
    const double points = std::min(known.point_count, max_mean_points);
    for (int axis = 0; axis < 3; ++axis) {
      const double steps = std::clamp(offset[axis] * offset_steps - 0.5, 0.0, offset_steps - 1.0);
      live.offset_sum.at(static_cast<std::size_t>(axis)) =
          static_cast<std::uint32_t>(std::lround(steps * points));
    }
    position_.emplace(live.key, static_cast<std::uint32_t>(voxels_.size()));
    voxels_.push_back(live);
  }
  sort_new_voxels();
}

LiveTile::LiveVoxel* LiveTile::find(const TilePoint& point) {
  if (point.only_evidence) {
    const auto known = position_.find(point.voxel_key);
    return known == position_.end() ? nullptr : &voxels_[known->second];
  }
  const auto [slot, is_new] =
      position_.try_emplace(point.voxel_key, static_cast<std::uint32_t>(voxels_.size()));
  if (is_new) voxels_.emplace_back().key = point.voxel_key;
  return &voxels_[slot->second];
}

ClassEvidence LiveTile::evidence(std::uint32_t voxel_key) const {
  const auto known = position_.find(voxel_key);
  return known == position_.end() ? ClassEvidence() : voxels_[known->second].evidence;
}

void LiveTile::insert(std::span<const TilePoint> points, std::int64_t stamp_ns) {
  LiveVoxel* voxel = nullptr;
  for (const TilePoint& point : points) {
    // Neighbours on a beam mostly share a voxel: no look-up for them.
    if (voxel == nullptr || voxel->key != point.voxel_key) voxel = find(point);
    if (voxel == nullptr) continue;
    voxel->evidence.add(point.label, point.confidence);
    voxel->last_seen_ns = stamp_ns;
    if (point.only_evidence) continue;
    if (voxel->point_count == 0) voxel->first_seen_ns = stamp_ns;
    if (voxel->point_count < max_mean_points) {
      for (std::size_t axis = 0; axis < 3; ++axis) voxel->offset_sum[axis] += point.offset[axis];
    }
    if (voxel->point_count < std::numeric_limits<std::uint32_t>::max()) ++voxel->point_count;
  }
}

void LiveTile::sort_new_voxels() {
  const auto known = static_cast<std::ptrdiff_t>(sorted_.size());
  sorted_.resize(voxels_.size());
  const auto middle = sorted_.begin() + known;
  std::iota(middle, sorted_.end(), static_cast<std::uint32_t>(known));
  const auto by_key = [this](std::uint32_t a, std::uint32_t b) {
    return voxels_[a].key < voxels_[b].key;
  };
  std::sort(middle, sorted_.end(), by_key);
  std::inplace_merge(sorted_.begin(), middle, sorted_.end(), by_key);
}

Voxel LiveTile::voxel(const LiveVoxel& live, const VoxelGrid& grid) const {
  Voxel voxel;
  voxel.index = voxel_index(live.key);
  voxel.point_count = live.point_count;
  const Eigen::Vector3d sum(live.offset_sum[0], live.offset_sum[1], live.offset_sum[2]);
  const Eigen::Vector3d steps =
      (sum / std::min(live.point_count, max_mean_points)).array() + 0.5;  // a step's middle
  voxel.mean_map =
      (grid.corner_map(id_, voxel.index) + steps * (grid.voxel_size_m() / offset_steps))
          .cast<float>();
  voxel.evidence = live.evidence;
  voxel.first_seen_ns = live.first_seen_ns;
  voxel.last_seen_ns = live.last_seen_ns;
  return voxel;
}

std::vector<Voxel> LiveTile::visible_voxels(std::uint32_t min_points, const VoxelGrid& grid) const {
  std::vector<Voxel> visible;
  visible.reserve(sorted_.size());
  for (const std::uint32_t position : sorted_) {
    const LiveVoxel& live = voxels_[position];
    if (live.point_count < min_points || is_movable(live.evidence.winner())) continue;
    visible.push_back(voxel(live, grid));
  }
  return visible;
}

bool LiveTile::publish(std::uint64_t revision, std::uint32_t min_points, const VoxelGrid& grid) {
  sort_new_voxels();
  Tile next = make_tile(id_, revision, visible_voxels(min_points, grid), grid);
  if (next.voxels.empty()) return std::exchange(published_, nullptr) != nullptr;
  if (published_ && published_->info.content_hash == next.info.content_hash) return false;
  next.voxels.shrink_to_fit();
  published_ = std::make_shared<const Tile>(std::move(next));
  return true;
}

}  // namespace stillmap
