#pragma once

#include <optional>
#include <string>

#include "core/occupancy/occupancy_query.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "octomap_msgs.h"
#include "stillmap_occupancy.h"

namespace stillmap::wire {

[[nodiscard]] stillmap_msgs::srv::QueryOccupancy_Request to_request(const OccupancyQuery& query);
[[nodiscard]] OccupancyQuery from_request(
    const stillmap_msgs::srv::QueryOccupancy_Request& request);

/// The answers into a response, whose status is not touched.
void write_answers(const OccupancyAnswers& answers,
                   stillmap_msgs::srv::QueryOccupancy_Response& response);
/// Nothing when the response makes no sense.
[[nodiscard]] std::optional<OccupancyAnswers> from_response(
    const stillmap_msgs::srv::QueryOccupancy_Response& response);

[[nodiscard]] octomap_msgs::msg::Octomap to_octomap(const OctomapData& data, std::int64_t stamp_ns,
                                                    const std::string& map_frame);

/// Nothing for a message that holds another kind of tree. Whether its bytes are an octree is for
/// check_octomap to say.
[[nodiscard]] std::optional<OctomapData> from_octomap(const octomap_msgs::msg::Octomap& message);

}  // namespace stillmap::wire
