#include "idl/conversions/removed_voxels.hpp"

namespace stillmap::wire {
namespace {

namespace reasons = stillmap_msgs::srv::GetRemoved_Request_Constants;
static_assert(static_cast<std::uint8_t>(RemovalReason::moving) == reasons::MOVING &&
              static_cast<std::uint8_t>(RemovalReason::semi_static) == reasons::SEMI_STATIC &&
              static_cast<std::uint8_t>(RemovalReason::seen_through) == reasons::SEEN_THROUGH &&
              static_cast<std::uint8_t>(RemovalReason::relabelled) == reasons::RELABELLED);

}  // namespace

void write_removed(const std::vector<RemovedVoxel>& removed,
                   stillmap_msgs::srv::GetRemoved_Response& response) {
  for (const RemovedVoxel& voxel : removed) {
    response.x().push_back(voxel.position_map.x());
    response.y().push_back(voxel.position_map.y());
    response.z().push_back(voxel.position_map.z());
    response.label().push_back(static_cast<std::uint8_t>(voxel.label));
    response.reason().push_back(static_cast<std::uint8_t>(voxel.reason));
    response.last_seen_ns().push_back(voxel.last_seen_ns);
  }
}

std::optional<std::vector<RemovedVoxel>> from_response(
    const stillmap_msgs::srv::GetRemoved_Response& response) {
  const std::size_t count = response.x().size();
  if (response.y().size() != count || response.z().size() != count ||
      response.label().size() != count || response.reason().size() != count ||
      response.last_seen_ns().size() != count) {
    return std::nullopt;
  }
  std::vector<RemovedVoxel> removed(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto reason = removal_reason(response.reason()[i]);
    if (!reason || response.label()[i] >= semantic_class_count) return std::nullopt;
    removed[i] = {{response.x()[i], response.y()[i], response.z()[i]},
                  static_cast<SemanticClass>(response.label()[i]),
                  *reason,
                  response.last_seen_ns()[i]};
  }
  return removed;
}

std::optional<RemovalReason> removal_reason(std::uint8_t number) {
  if (number >= removal_reason_count) return std::nullopt;
  return static_cast<RemovalReason>(number);
}

}  // namespace stillmap::wire
