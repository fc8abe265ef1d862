#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_query.hpp"
#include "stillmap_msgs.h"
#include "traversability.h"

namespace stillmap::wire {

/// Of an answer about an area.
[[nodiscard]] stillmap_msgs::msg::ReplyStatus to_reply_status(TraversabilityStatus status,
                                                              const std::string& reason,
                                                              std::uint64_t map_version,
                                                              std::uint64_t map_id);

/// Nothing for a code that no answer about an area has; that includes `failed`.
[[nodiscard]] std::optional<TraversabilityStatus> traversability_status(
    const stillmap_msgs::msg::ReplyStatus& status);

/// Nothing for a number that has no state, no reason.
[[nodiscard]] std::optional<CellState> cell_state(std::uint8_t number);
[[nodiscard]] std::optional<BlockReason> block_reason(std::uint8_t number);

/// Most cells of an answer: 16 MB, a square of 280 m in cells of 0.2 m.
inline constexpr std::uint32_t max_answered_cells = 2'000'000;

[[nodiscard]] stillmap_msgs::srv::GetTraversableArea_Request to_request(
    const TraversabilityQuery& query);

/// Either a query, its `max_cells` not above that of an answer, or what is wrong with the
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
