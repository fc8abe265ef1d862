#pragma once

#include "core/occupancy/voxel_bricks.hpp"

namespace stillmap {

/// Walks along a line through a grid of unit cubes, from cube to neighbouring cube (Amanatides and
/// Woo, 1987). Positions are in voxels.
class RayIterator {
 public:
  /// `direction` is of length 1. Requires a start of less than 2^30 voxels from the origin.
  RayIterator(const Eigen::Vector3d& start, const Eigen::Vector3d& direction);

  [[nodiscard]] const VoxelKey& voxel() const { return voxel_; }
  /// How far along the line this voxel begins; 0 for the one where it starts.
  [[nodiscard]] double entered_at() const { return entered_at_; }
  /// How far along the line the next voxel begins.
  [[nodiscard]] double next_at() const { return next_at_[axis_]; }
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

}  // namespace stillmap
