#include "clients/library/connection.hpp"
#include "idl/conversions/region.hpp"
#include "idl/conversions/removed_voxels.hpp"

namespace stillmap {

RemovedVoxels Client::get_removed(const Region& region, std::uint32_t max_voxels) {
  const std::string& name = connection_->names.get_removed;
  stillmap_msgs::srv::GetRemoved_Request request;
  request.region(wire::to_wire(region));
  request.max_voxels(max_voxels);
  const auto reply = connection_->call_ok(connection_->get_removed, name, std::move(request));
  auto voxels = wire::from_response(reply);
  if (!voxels) throw malformed_reply(name);
  return {*std::move(voxels), reply.total()};
}

std::uint64_t Client::restore_removed(RemovalReason reason, const BoxRegion& box) {
  stillmap_msgs::srv::RestoreRemoved_Request request;
  request.region(wire::to_wire(Region(box)));
  request.reason(static_cast<std::uint8_t>(reason));
  const std::string& name = connection_->names.restore_removed;
  return connection_->call_ok(connection_->restore_removed, name, std::move(request)).restored();
}

}  // namespace stillmap
