#include "idl/conversions/traversability_status.hpp"

#include "idl/conversions/map_query.hpp"
#include "traversability.h"

namespace stillmap::wire {
namespace {

namespace codes = stillmap_msgs::msg::TraversabilityGrid_Constants;
static_assert(static_cast<std::uint8_t>(CellState::unknown) == codes::STATE_UNKNOWN &&
              static_cast<std::uint8_t>(CellState::free) == codes::STATE_FREE &&
              static_cast<std::uint8_t>(CellState::lethal) == codes::STATE_LETHAL);
static_assert(static_cast<std::uint8_t>(BlockReason::none) == codes::REASON_NONE &&
              static_cast<std::uint8_t>(BlockReason::obstacle) == codes::REASON_OBSTACLE &&
              static_cast<std::uint8_t>(BlockReason::low_headroom) == codes::REASON_LOW_HEADROOM &&
              static_cast<std::uint8_t>(BlockReason::step) == codes::REASON_STEP &&
              static_cast<std::uint8_t>(BlockReason::slope) == codes::REASON_SLOPE &&
              static_cast<std::uint8_t>(BlockReason::roughness) == codes::REASON_ROUGHNESS &&
              static_cast<std::uint8_t>(BlockReason::ground_class) == codes::REASON_GROUND_CLASS &&
              static_cast<std::uint8_t>(BlockReason::inscribed) == codes::REASON_INFLATION &&
              static_cast<std::uint8_t>(BlockReason::unknown) == codes::REASON_UNKNOWN);

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
