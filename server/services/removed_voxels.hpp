#pragma once

#include <functional>
#include <vector>

#include "core/map/tile.hpp"
#include "removed_voxels.h"
#include "server/services/service_context.hpp"

namespace stillmap::server {

/// Who keeps what was removed. Both are done between two scans.
struct RemovedSource {
  std::function<std::vector<RemovedVoxel>(const Eigen::AlignedBox3d& box_map)> removed;
  /// Returns how many voxels.
  std::function<std::size_t(RemovalReason reason, const Eigen::AlignedBox3d& box_map)> restore;
};

/// What is kept out of the static map in a region.
[[nodiscard]] stillmap_msgs::srv::GetRemoved_Response get_removed(
    const ServiceContext& context, const RemovedSource& source,
    const stillmap_msgs::srv::GetRemoved_Request& request);

/// Shows again what was removed in a box.
[[nodiscard]] stillmap_msgs::srv::RestoreRemoved_Response restore_removed(
    const ServiceContext& context, const RemovedSource& source,
    const stillmap_msgs::srv::RestoreRemoved_Request& request);

}  // namespace stillmap::server
