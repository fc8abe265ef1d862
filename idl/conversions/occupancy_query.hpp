#pragma once

#include <optional>

#include "core/occupancy/occupancy_query.hpp"
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

}  // namespace stillmap::wire
