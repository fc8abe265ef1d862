#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "std_msgs.h"

namespace stillmap::wire {

/// Nanoseconds since the Unix epoch to ROS 2's stamp. Must lie within 1901..2038 (32-bit seconds).
[[nodiscard]] builtin_interfaces::msg::Time to_stamp(std::int64_t stamp_ns);

/// Nothing when the nanoseconds are no fraction of a second.
[[nodiscard]] std::optional<std::int64_t> stamp_ns(const builtin_interfaces::msg::Time& stamp);

[[nodiscard]] std_msgs::msg::Header to_header(std::int64_t stamp_ns, const std::string& frame);

}  // namespace stillmap::wire
