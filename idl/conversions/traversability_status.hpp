#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/traversability/path_check.hpp"
#include "stillmap_msgs.h"

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

}  // namespace stillmap::wire
