#pragma once

#include <optional>
#include <string>

#include "core/occupancy/octomap_data.hpp"
#include "octomap_msgs.h"

namespace stillmap::wire {

[[nodiscard]] octomap_msgs::msg::Octomap to_octomap(const OctomapData& data, std::int64_t stamp_ns,
                                                    const std::string& map_frame);

/// Nothing for a message that holds another kind of tree. Whether its bytes are an octree is for
/// check_octomap to say.
[[nodiscard]] std::optional<OctomapData> from_octomap(const octomap_msgs::msg::Octomap& message);

}  // namespace stillmap::wire
