#pragma once

#include <optional>
#include <vector>

#include "core/map/tile.hpp"
#include "removed_voxels.h"

namespace stillmap::wire {

/// The voxels into a response, whose status and total are not touched.
void write_removed(const std::vector<RemovedVoxel>& removed,
                   stillmap_msgs::srv::GetRemoved_Response& response);
/// Nothing when the arrays differ in length or hold what is no class or no reason.
[[nodiscard]] std::optional<std::vector<RemovedVoxel>> from_response(
    const stillmap_msgs::srv::GetRemoved_Response& response);

/// Nothing for a number that has no reason.
[[nodiscard]] std::optional<RemovalReason> removal_reason(std::uint8_t number);

}  // namespace stillmap::wire
