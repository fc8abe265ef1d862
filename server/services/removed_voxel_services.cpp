#include "server/services/removed_voxel_services.hpp"

#include <utility>

namespace stillmap::server {

RemovedVoxelServices::RemovedVoxelServices(dds::Participant& participant,
                                           const dds::Services& names, ServiceContext context,
                                           RemovedSource source)
    : context_(std::move(context)),
      source_(std::move(source)),
      get_removed_(participant, names.get_removed,
                   logged(context_.log, names.get_removed,
                          [this](const auto& request) { return removed(request); })),
      restore_removed_(participant, names.restore_removed,
                       logged(context_.log, names.restore_removed,
                              [this](const auto& request) { return restore(request); })) {}

stillmap_msgs::srv::GetRemoved_Response RemovedVoxelServices::removed(
    const stillmap_msgs::srv::GetRemoved_Request& request) const {
  return get_removed(context_, source_, request);
}

stillmap_msgs::srv::RestoreRemoved_Response RemovedVoxelServices::restore(
    const stillmap_msgs::srv::RestoreRemoved_Request& request) const {
  return restore_removed(context_, source_, request);
}

}  // namespace stillmap::server
