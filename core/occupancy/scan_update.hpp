#pragma once

#include <tsl/robin_map.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/throttle_callback.hpp"
#include "core/occupancy/occupancy_config.hpp"
#include "core/occupancy/octree_grid.hpp"

namespace stillmap {

/// 4 x 4 x 4 voxels, one bit each, in the octree's own order: bit 8 * octant + child.
struct VoxelBrick {
  /// Place among all bricks in the octree's order (x, y, z bits interleaved).
  std::uint64_t order = 0;
  /// Voxels that points fell into.
  std::uint64_t hits = 0;
  /// Voxels that rays passed.
  std::uint64_t misses = 0;
  /// Octants where a ray ended already.
  std::uint64_t ray_ends = 0;
};

/// What one scan tells of the voxels round it, gathered before the octree is touched, so that each
/// voxel changes once a scan. Keeps its memory from scan to scan.
class VoxelBricks {
 public:
  void clear();

  /// The brick of the voxel, made if need be; valid until the next call.
  [[nodiscard]] VoxelBrick& brick_of(const VoxelKey& voxel) {
    const std::uint64_t key = key_of(voxel);
    // Rays and surfaces stay in a brick for some voxels.
    return key == last_key_ ? bricks_[last_] : find_or_make(key);
  }
  /// The voxel's bit in its brick.
  [[nodiscard]] static std::uint64_t bit_of(const VoxelKey& voxel) {
    return std::uint64_t{1} << (8U * corner(voxel, 1) + corner(voxel, 0));
  }
  /// The bits of the 2 x 2 x 2 voxels that are its octant of the brick.
  [[nodiscard]] static std::uint64_t octant_of(const VoxelKey& voxel) {
    return std::uint64_t{0xFF} << (8U * corner(voxel, 1));
  }

  /// All bricks in the octree's order; a voxel that was hit is not a miss, too.
  [[nodiscard]] std::span<const VoxelBrick> sorted();

 private:
  /// Neighbouring bricks must not share slots.
  struct KeyHash {
    std::size_t operator()(std::uint64_t key) const { return key * 0x9E3779B97F4A7C15ULL >> 20U; }
  };

  static constexpr std::uint64_t no_key = ~std::uint64_t{0};

  /// Octant or child: one bit of each coordinate.
  [[nodiscard]] static unsigned corner(const VoxelKey& voxel, unsigned bit) {
    return (static_cast<unsigned>(voxel.x()) >> bit & 1U) |
           (static_cast<unsigned>(voxel.y()) >> bit & 1U) << 1U |
           (static_cast<unsigned>(voxel.z()) >> bit & 1U) << 2U;
  }

  /// The brick's x, y and z, 14 bits each.
  [[nodiscard]] static std::uint64_t key_of(const VoxelKey& voxel) {
    const auto part = [](std::int32_t v) { return static_cast<std::uint64_t>(v) >> 2U; };
    return part(voxel.x()) << 28U | part(voxel.y()) << 14U | part(voxel.z());
  }
  [[nodiscard]] VoxelBrick& find_or_make(std::uint64_t key);

  std::vector<VoxelBrick> bricks_;
  tsl::robin_map<std::uint64_t, std::uint32_t, KeyHash> index_;
  std::uint64_t last_key_ = no_key;
  std::uint32_t last_ = 0;
};

/// Gathers what a scan tells: the voxels of its stationary points, and, where it clears, those that
/// its rays pass within the clearing range, points of movable things included. One ray for each
/// cube of 2 x 2 x 2 voxels that rays end in. Points that are not finite, or outside the octree,
/// tell nothing; nor does a scan whose lidar is outside.
void compute_scan_update(const OccupancyConfig& config, const LabelledScan& scan,
                         const Eigen::Isometry3d& T_map_lidar, const ScanUpdateOptions& use,
                         VoxelBricks& bricks, const ThrottleCallback& throttle = {});

}  // namespace stillmap
