#pragma once

#include "idl/dds/service_server.hpp"
#include "idl/interface/topics.hpp"
#include "server/services/removed_voxels.hpp"

namespace stillmap::server {

/// What was kept out of the static map, and the way back into it.
class RemovedVoxelServices {
 public:
  RemovedVoxelServices(dds::Participant& participant, const dds::Services& names,
                       ServiceContext context, RemovedSource source);

 private:
  [[nodiscard]] stillmap_msgs::srv::GetRemoved_Response removed(
      const stillmap_msgs::srv::GetRemoved_Request& request) const;
  [[nodiscard]] stillmap_msgs::srv::RestoreRemoved_Response restore(
      const stillmap_msgs::srv::RestoreRemoved_Request& request) const;

  ServiceContext context_;
  RemovedSource source_;
  dds::ServiceServer<stillmap_msgs::srv::GetRemoved_Request,
                     stillmap_msgs::srv::GetRemoved_Response>
      get_removed_;
  dds::ServiceServer<stillmap_msgs::srv::RestoreRemoved_Request,
                     stillmap_msgs::srv::RestoreRemoved_Response>
      restore_removed_;
};

}  // namespace stillmap::server
