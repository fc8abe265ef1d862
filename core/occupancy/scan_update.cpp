#include "core/occupancy/scan_update.hpp"

#include <algorithm>

#include "core/occupancy/octree_grid.hpp"

namespace stillmap {
namespace {

/// Inserts two zero bits after each bit of a 14-bit number.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 16U) & 0x030000FF0000FFULL;
  bits = (bits | bits << 8U) & 0x0300F00F00F00FULL;
  bits = (bits | bits << 4U) & 0x030C30C30C30C3ULL;
  return (bits | bits << 2U) & 0x09249249249249ULL;
}

/// Morton code of a brick's key.
std::uint64_t order_of(std::uint64_t key) {
  constexpr std::uint64_t all = (1U << 14U) - 1U;
  return spread(key >> 28U) | spread(key >> 14U & all) << 1U | spread(key & all) << 2U;
}

constexpr std::size_t points_between_throttle_calls = 64;

bool is_solid(const LabelledScan& scan, std::size_t i, const ScanUpdateOptions& use) {
  if (scan.motion[i] != Motion::stationary) return false;
  return use.unknown_is_solid || scan.label(i) != SemanticClass::unlabeled;
}

/// Positions are in voxels from the octree's lowest corner.
class HitsAndMisses {
 public:
  HitsAndMisses(const OccupancyConfig& config, const Eigen::Isometry3d& T_map_lidar,
                VoxelBricks& bricks)
      : config_(config),
        T_map_lidar_(T_map_lidar),
        bricks_(bricks),
        lidar_(in_voxels(T_map_lidar.translation())) {}

  [[nodiscard]] bool lidar_is_inside() const { return in_octree(lidar_); }

  void hit(const Eigen::Vector3d& p_lidar) {
    if (!(p_lidar.squaredNorm() <= config_.max_range_m * config_.max_range_m)) return;
    const Eigen::Vector3d p = in_voxels(T_map_lidar_ * p_lidar);
    if (!in_octree(p)) return;
    const VoxelKey voxel = p.array().floor().cast<std::int32_t>();
    bricks_.brick_of(voxel).hits |= VoxelBricks::bit_of(voxel);
  }

  void clear_towards(const Eigen::Vector3d& p_lidar) {
    const double range_m = p_lidar.norm();
    const double margin_m = config_.clearing_margin_m + config_.clearing_margin_share * range_m;
    const double length_m = std::min(range_m - margin_m, config_.clearing_range_m);
    // Negated so that NaN fails.
    if (!(length_m > 0.0) || !std::isfinite(range_m)) return;
    const Eigen::Vector3d direction = T_map_lidar_.linear() * (p_lidar / range_m);
    const double length = length_m / config_.resolution_m;
    const Eigen::Vector3d end = lidar_ + length * direction;
    if (!in_octree(end)) return;
    const VoxelKey end_voxel = end.array().floor().cast<std::int32_t>();
    VoxelBrick& brick = bricks_.brick_of(end_voxel);
    const std::uint64_t octant = VoxelBricks::octant_of(end_voxel);
    if ((brick.ray_ends & octant) != 0) return;
    brick.ray_ends |= octant;
    for (RayIterator ray(lidar_, direction); ray.entered_at() < length; ray.step()) {
      bricks_.brick_of(ray.voxel()).misses |= VoxelBricks::bit_of(ray.voxel());
    }
  }

 private:
  [[nodiscard]] Eigen::Vector3d in_voxels(const Eigen::Vector3d& p_map) const {
    return (p_map / config_.resolution_m).array() + octree_origin;
  }

  const OccupancyConfig& config_;
  const Eigen::Isometry3d& T_map_lidar_;
  VoxelBricks& bricks_;
  Eigen::Vector3d lidar_;
};

}  // namespace

void VoxelBricks::clear() {
  bricks_.clear();
  index_.clear();
  last_key_ = no_key;
}

VoxelBrick& VoxelBricks::find_or_make(std::uint64_t key) {
  const auto [entry, is_new] = index_.try_emplace(key, static_cast<std::uint32_t>(bricks_.size()));
  if (is_new) bricks_.push_back({.order = order_of(key)});
  last_key_ = key;
  last_ = entry->second;
  return bricks_[last_];
}

std::span<const VoxelBrick> VoxelBricks::sorted() {
  for (VoxelBrick& brick : bricks_) brick.misses &= ~brick.hits;
  std::ranges::sort(bricks_, {}, &VoxelBrick::order);
  // Sorting invalidates the indices.
  index_.clear();
  last_key_ = no_key;
  return bricks_;
}

void compute_scan_update(const OccupancyConfig& config, const LabelledScan& scan,
                         const Eigen::Isometry3d& T_map_lidar, const ScanUpdateOptions& use,
                         VoxelBricks& bricks, const ThrottleCallback& throttle) {
  HitsAndMisses collected(config, T_map_lidar, bricks);
  if (!collected.lidar_is_inside()) return;
  for (std::size_t i = 0; i < scan.scan.size(); ++i) {
    if (throttle && i % points_between_throttle_calls == 0) throttle();
    const Eigen::Vector3d p_lidar = scan.scan.points_lidar[i].cast<double>();
    if (is_solid(scan, i, use)) collected.hit(p_lidar);
    if (use.clear_free_space) collected.clear_towards(p_lidar);
  }
}

}  // namespace stillmap
