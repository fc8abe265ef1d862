#pragma once

#include <optional>
#include <string>

#include "core/map/query/map_query.hpp"
#include "stillmap_msgs.h"

namespace stillmap::wire {

/// Codes of stillmap_msgs/ReplyStatus; the first are those of QueryStatus.
enum class ReplyCode : std::uint8_t {
  ok = stillmap_msgs::msg::ReplyStatus_Constants::OK,
  invalid_request = stillmap_msgs::msg::ReplyStatus_Constants::INVALID_REQUEST,
  stale_continuation = stillmap_msgs::msg::ReplyStatus_Constants::STALE_CONTINUATION,
  failed = stillmap_msgs::msg::ReplyStatus_Constants::FAILED,
  changes_unknown = stillmap_msgs::msg::ReplyStatus_Constants::CHANGES_UNKNOWN,
  too_large = stillmap_msgs::msg::ReplyStatus_Constants::TOO_LARGE,
  not_found = stillmap_msgs::msg::ReplyStatus_Constants::NOT_FOUND,
};

[[nodiscard]] stillmap_msgs::msg::ReplyStatus to_reply_status(ReplyCode code,
                                                              const std::string& reason,
                                                              std::uint64_t map_version,
                                                              std::uint64_t map_id);

/// Why a request of this format version cannot be understood; nothing when it can.
[[nodiscard]] std::optional<std::string> version_fault(std::uint8_t format_version);

[[nodiscard]] stillmap_msgs::srv::GetStaticMap_Request to_request(const MapQuery& query);

/// Either a query or what is wrong with the request. Whether the region makes sense is
/// for query_map to say.
struct QueryFromRequest {
  std::optional<MapQuery> query;
  std::string fault;
};
[[nodiscard]] QueryFromRequest from_request(
    const stillmap_msgs::srv::GetStaticMap_Request& request);

[[nodiscard]] stillmap_msgs::srv::GetStaticMap_Response to_response(const MapQueryResult& result);

/// Nothing when the arrays of the response do not fit each other.
[[nodiscard]] std::optional<MapQueryResult> from_response(
    const stillmap_msgs::srv::GetStaticMap_Response& response);

}  // namespace stillmap::wire
