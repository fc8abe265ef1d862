#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>

namespace stillmap {

/// Voxel key of the octree: 0..65535 along each axis; 32768 begins at the map's origin.
using VoxelKey = Eigen::Matrix<std::int32_t, 3, 1>;

/// Voxels along an axis of the octree, and the key at the map's origin.
inline constexpr std::int32_t octree_side = 65536;
inline constexpr std::int32_t octree_origin = 32768;

/// Whether a position, in voxels from the octree's lowest corner, lies in the octree. False for
/// NaN.
[[nodiscard]] inline bool in_octree(const Eigen::Vector3d& p_voxels) {
  // One voxel of margin: rounding along a ray could step outside.
  return (p_voxels.array() >= 1.0).all() && (p_voxels.array() < octree_side - 1.0).all();
}

/// Iterates over the unit cubes that a line traverses (Amanatides and Woo, "A fast voxel traversal
/// algorithm", 1987). Positions are in voxels.
class RayIterator {
 public:
  /// @pre `direction` has length 1; `start` is within 2^30 voxels of the origin.
  RayIterator(const Eigen::Vector3d& start, const Eigen::Vector3d& direction);

  [[nodiscard]] const VoxelKey& voxel() const { return voxel_; }
  /// Distance along the line at which this voxel begins; 0 for the first.
  [[nodiscard]] double entered_at() const { return entered_at_; }
  void step() {
    entered_at_ = next_at_[axis_];
    voxel_[axis_] += step_[axis_];
    next_at_[axis_] += voxel_length_[axis_];
    choose_axis();
  }

 private:
  void choose_axis() {
    axis_ = next_at_[0] <= next_at_[1] ? 0 : 1;
    if (next_at_[2] < next_at_[axis_]) axis_ = 2;
  }

  VoxelKey voxel_;
  VoxelKey step_;
  Eigen::Vector3d next_at_;
  Eigen::Vector3d voxel_length_;
  double entered_at_ = 0.0;
  Eigen::Index axis_ = 0;
};

inline RayIterator::RayIterator(const Eigen::Vector3d& start, const Eigen::Vector3d& direction)
    : voxel_(start.array().floor().cast<std::int32_t>()) {
  constexpr double never = std::numeric_limits<double>::infinity();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const bool forwards = direction[axis] > 0.0;
    const double speed = std::abs(direction[axis]);
    step_[axis] = forwards ? 1 : -1;
    const double in_voxel = start[axis] - voxel_[axis];
    const bool moves = speed > 0.0;
    next_at_[axis] = moves ? (forwards ? 1.0 - in_voxel : in_voxel) / speed : never;
    voxel_length_[axis] = moves ? 1.0 / speed : never;
  }
  choose_axis();
}

}  // namespace stillmap
