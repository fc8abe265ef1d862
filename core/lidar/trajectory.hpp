#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

namespace stillmap {

struct StampedPose {
  std::int64_t stamp_ns = 0;
  /// Takes points of the lidar frame to the map frame [m]. In what a server with `frames.base`
  /// publishes and stores: points of that frame.
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
};

/// The poses of one run after the other. Within a run stamps increase; a run may begin with an
/// earlier stamp than the one before it ended with.
using Trajectory = std::vector<StampedPose>;

}  // namespace stillmap
