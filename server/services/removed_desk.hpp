#pragma once

#include <functional>
#include <vector>

#include "core/map/removed_voxel.hpp"
#include "idl/dds/service_server.hpp"
#include "idl/topics.hpp"
#include "removed_voxels.h"
#include "server/services/service_context.hpp"

namespace stillmap {

/// Who keeps what was removed. Both are done between two scans.
struct RemovedSource {
  std::function<std::vector<RemovedVoxel>(const Eigen::AlignedBox3d& box_map)> removed;
  /// Returns how many voxels.
  std::function<std::size_t(RemovalReason reason, const Eigen::AlignedBox3d& box_map)> restore;
};

/// What was kept out of the static map, and the way back into it.
class RemovedDesk {
 public:
  RemovedDesk(Participant& participant, const Services& names, ServiceContext context,
              RemovedSource source);

 private:
  [[nodiscard]] stillmap_msgs::srv::GetRemoved_Response removed(
      const stillmap_msgs::srv::GetRemoved_Request& request) const;
  [[nodiscard]] stillmap_msgs::srv::RestoreRemoved_Response restore(
      const stillmap_msgs::srv::RestoreRemoved_Request& request) const;

  ServiceContext context_;
  RemovedSource source_;
  ServiceServer<stillmap_msgs::srv::GetRemoved_Request, stillmap_msgs::srv::GetRemoved_Response>
      get_removed_;
  ServiceServer<stillmap_msgs::srv::RestoreRemoved_Request,
                stillmap_msgs::srv::RestoreRemoved_Response>
      restore_removed_;
};

}  // namespace stillmap
