#pragma once

#include <tsl/robin_map.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/voxel_index.hpp"
#include "core/map/throttle_callback.hpp"
#include "core/occupancy/occupancy_config.hpp"
#include "core/occupancy/octree_grid.hpp"

namespace stillmap {

/// 4 x 4 x 4 voxels, one bit each, in the octree's child order: bit 8 * octant + child.
struct VoxelBrick {
  /// Morton code of the brick (x, y, z bits interleaved): the octree's traversal order.
  std::uint64_t order = 0;
  /// Voxels that contain points.
  std::uint64_t hits = 0;
  /// Voxels that rays traversed.
  std::uint64_t misses = 0;
  /// Octants in which a ray has ended.
  std::uint64_t ray_ends = 0;
};

/// Hits and misses of one scan, collected before the octree is changed, so that each voxel is
/// updated once a scan. Keeps its memory from scan to scan.
class VoxelBricks {
 public:
  void clear();

  /// The brick that holds the voxel, created if missing; valid until the next call.
  [[nodiscard]] VoxelBrick& brick_of(const VoxelKey& voxel) {
    const std::uint64_t key = key_of(voxel);
    // Consecutive voxels of a ray or surface mostly share a brick.
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

  /// All bricks in the octree's order; hits take precedence over misses.
  [[nodiscard]] std::span<const VoxelBrick> sorted();

 private:
  static constexpr std::uint64_t no_key = ~std::uint64_t{0};

  /// Octant or child index: one bit of each coordinate.
  [[nodiscard]] static unsigned corner(const VoxelKey& voxel, unsigned bit) {
    return (static_cast<unsigned>(voxel.x()) >> bit & 1U) |
           (static_cast<unsigned>(voxel.y()) >> bit & 1U) << 1U |
           (static_cast<unsigned>(voxel.z()) >> bit & 1U) << 2U;
  }

  /// The brick's x, y and z indices, 14 bits each.
  [[nodiscard]] static std::uint64_t key_of(const VoxelKey& voxel) {
    const auto part = [](std::int32_t v) { return static_cast<std::uint64_t>(v) >> 2U; };
    return part(voxel.x()) << 28U | part(voxel.y()) << 14U | part(voxel.z());
  }
  [[nodiscard]] VoxelBrick& find_or_make(std::uint64_t key);

  std::vector<VoxelBrick> bricks_;
  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> index_;
  std::uint64_t last_key_ = no_key;
  std::uint32_t last_ = 0;
};

/// Collects the hits and misses of a scan: hits are the voxels of its stationary points; misses, if
/// it clears, the voxels that the rays of all its points traverse within the clearing range, one
/// ray for each cube of 2 x 2 x 2 voxels in which rays end. Points that are not finite or outside
/// the octree are ignored, as is a scan whose lidar is outside. `throttle` is called between
/// points.
void compute_scan_update(const OccupancyConfig& config, const LabelledScan& scan,
                         const Eigen::Isometry3d& T_map_lidar, const ScanUpdateOptions& use,
                         VoxelBricks& bricks, const ThrottleCallback& throttle = {});

}  // namespace stillmap
