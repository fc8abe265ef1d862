#pragma once

#include <optional>
#include <string>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_view.hpp"
#include "traversability.h"

namespace stillmap::wire {

[[nodiscard]] stillmap_msgs::srv::CheckPath_Request to_request(const PathQuery& query);

/// Either a query or what is wrong with the request. Whether the path makes sense is for check_path
/// to say.
struct PathQueryFromRequest {
  std::optional<PathQuery> query;
  std::string fault;
};
[[nodiscard]] PathQueryFromRequest from_request(
    const stillmap_msgs::srv::CheckPath_Request& request);

[[nodiscard]] stillmap_msgs::srv::CheckPath_Response to_response(const PathCheck& check,
                                                                 std::uint64_t map_id);
/// Nothing when codes do not exist.
[[nodiscard]] std::optional<PathCheck> from_response(
    const stillmap_msgs::srv::CheckPath_Response& response);

[[nodiscard]] stillmap_msgs::srv::NearestTraversable_Response to_response(
    const NearestTraversable& nearest, std::uint64_t map_id);
/// Nothing when codes do not exist. The cell is free.
[[nodiscard]] std::optional<NearestTraversable> from_response(
    const stillmap_msgs::srv::NearestTraversable_Response& response);

}  // namespace stillmap::wire
