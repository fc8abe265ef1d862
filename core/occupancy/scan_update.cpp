#include "core/occupancy/scan_update.hpp"

#include "core/occupancy/ray_iterator.hpp"

namespace stillmap {
namespace {

constexpr std::size_t points_between_throttle_calls = 64;

bool is_solid(const LabelledScan& scan, std::size_t i, const ScanUpdateOptions& use) {
  if (scan.motion[i] != Motion::stationary) return false;
  return use.unknown_is_solid || scan.label(i) != SemanticClass::unlabeled;
}

/// Everything in voxels, from the octree's corner.
class Gathering {
 public:
  Gathering(const OccupancyConfig& config, const Eigen::Isometry3d& T_map_lidar,
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
    const double margin_m = config_.clear_margin_m + config_.clear_margin_share * range_m;
    const double length_m = std::min(range_m - margin_m, config_.clear_range_m);
    // Also false for NaN and infinite points.
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

bool in_octree(const Eigen::Vector3d& p_voxels) {
  // A voxel is kept off the ends, where rounding along a ray could step outside.
  return (p_voxels.array() >= 1.0).all() && (p_voxels.array() < octree_side - 1.0).all();
}

void compute_scan_update(const OccupancyConfig& config, const LabelledScan& scan,
                         const Eigen::Isometry3d& T_map_lidar, const ScanUpdateOptions& use,
                         VoxelBricks& bricks, const ThrottleCallback& throttle) {
  Gathering gathering(config, T_map_lidar, bricks);
  if (!gathering.lidar_is_inside()) return;
  for (std::size_t i = 0; i < scan.scan.size(); ++i) {
    if (throttle && i % points_between_throttle_calls == 0) throttle();
    const Eigen::Vector3d p_lidar = scan.scan.points_lidar[i].cast<double>();
    if (is_solid(scan, i, use)) gathering.hit(p_lidar);
    if (use.clear_free_space) gathering.clear_towards(p_lidar);
  }
}

}  // namespace stillmap
