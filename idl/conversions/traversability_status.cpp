#include "idl/conversions/traversability_status.hpp"

#include "idl/conversions/map_query.hpp"

namespace stillmap::wire {
namespace {

ReplyCode code_of(TraversabilityStatus status) {
  switch (status) {
    case TraversabilityStatus::ok:
      return ReplyCode::ok;
    case TraversabilityStatus::invalid_request:
      return ReplyCode::invalid_request;
    case TraversabilityStatus::too_large:
      return ReplyCode::too_large;
    case TraversabilityStatus::not_found:
      return ReplyCode::not_found;
  }
  return ReplyCode::failed;
}

}  // namespace

stillmap_msgs::msg::ReplyStatus to_reply_status(TraversabilityStatus status,
                                                const std::string& reason,
                                                std::uint64_t map_version, std::uint64_t map_id) {
  return to_reply_status(code_of(status), reason, map_version, map_id);
}

std::optional<TraversabilityStatus> traversability_status(
    const stillmap_msgs::msg::ReplyStatus& status) {
  for (const TraversabilityStatus candidate :
       {TraversabilityStatus::ok, TraversabilityStatus::invalid_request,
        TraversabilityStatus::too_large, TraversabilityStatus::not_found}) {
    if (status.code() == static_cast<std::uint8_t>(code_of(candidate))) return candidate;
  }
  return std::nullopt;
}

std::optional<CellState> cell_state(std::uint8_t number) {
  if (number > static_cast<std::uint8_t>(CellState::lethal)) return std::nullopt;
  return static_cast<CellState>(number);
}

std::optional<BlockReason> block_reason(std::uint8_t number) {
  if (number >= block_reason_count) return std::nullopt;
  return static_cast<BlockReason>(number);
}

}  // namespace stillmap::wire
