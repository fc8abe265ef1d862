#pragma once

#include <Eigen/Geometry>

#include "core/graph/pose_graph.hpp"
#include "core/graph/submap.hpp"
#include "core/odometry/odometry_state.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// A submap as other submaps are registered against it.
class SubmapTarget {
 public:
  explicit SubmapTarget(const Submap& submap);

  /// Registers another submap: from a start that is some decimetres off, then finely. The pose of
  /// the result is T_target_source. Lost where too little of them meets.
  [[nodiscard]] OdometryResult register_submap(
      const Submap& source, const Eigen::Isometry3d& T_target_source_guess) const;

 private:
  LocalMap map_;
};

/// Inverse covariance of a registration's pose in the form of a PoseEdge: what the registration
/// says of itself, and what it cannot know of (voxels, the submaps' own drift).
[[nodiscard]] Matrix6d edge_information(const OdometryResult& registration);

}  // namespace stillmap
