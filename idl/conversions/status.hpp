#pragma once

#include <optional>

#include "idl/interface/server_status.hpp"
#include "stillmap_msgs.h"

namespace stillmap::wire {

[[nodiscard]] stillmap_msgs::msg::Status to_wire(const dds::ServerStatus& status);

/// Nothing for a format version that is not ours, or numbers that stand for nothing.
[[nodiscard]] std::optional<dds::ServerStatus> from_wire(const stillmap_msgs::msg::Status& message);

}  // namespace stillmap::wire
