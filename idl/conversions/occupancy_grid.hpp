#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/traversability/occupancy_grid.hpp"
#include "nav_msgs.h"

namespace stillmap::wire {

/// nav_msgs/OccupancyGrid as Nav2 reads it. Its origin lies at height 0; map_load_time is the
/// stamp.
[[nodiscard]] nav_msgs::msg::OccupancyGrid to_message(const OccupancyGrid& grid,
                                                      std::int64_t stamp_ns,
                                                      const std::string& map_frame);

/// Nothing when there are not width * height values, or some are not -1..100. A rotated origin is
/// not supported: nothing.
[[nodiscard]] std::optional<OccupancyGrid> from_message(
    const nav_msgs::msg::OccupancyGrid& message);

}  // namespace stillmap::wire
