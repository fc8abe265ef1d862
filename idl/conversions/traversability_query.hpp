#pragma once

#include <optional>
#include <string>

#include "core/traversability/traversability_query.hpp"
#include "traversability.h"

namespace stillmap::wire {

/// Most cells that an answer brings: 16 MB, a square of 280 m in cells of 0.2 m.
inline constexpr std::uint32_t max_answered_cells = 2'000'000;

[[nodiscard]] stillmap_msgs::srv::GetTraversableArea_Request to_request(
    const TraversabilityQuery& query);

/// Either a query, its `max_cells` not above what an answer brings, or what is wrong with the
/// request. Whether the region makes sense is for query_traversability to say.
struct TraversabilityQueryFromRequest {
  std::optional<TraversabilityQuery> query;
  std::string fault;
};
[[nodiscard]] TraversabilityQueryFromRequest from_request(
    const stillmap_msgs::srv::GetTraversableArea_Request& request);

[[nodiscard]] stillmap_msgs::srv::GetTraversableArea_Response to_response(
    const TraversabilityAnswer& answer);

/// Nothing when codes do not exist or arrays do not fit each other.
[[nodiscard]] std::optional<TraversabilityAnswer> from_response(
    const stillmap_msgs::srv::GetTraversableArea_Response& response);

}  // namespace stillmap::wire
