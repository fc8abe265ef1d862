#pragma once

#include <cstdint>

namespace stillmap {

/// What happens to scans that come faster than they are mapped.
enum class DeliveryMode : std::uint8_t {
  /// The newest scans count: a best-effort reader and a queue that drops the oldest scan and counts
  /// it. For live sensors.
  latest = 0,
  /// Every scan counts: a reliable KEEP_ALL reader whose full queue makes the publisher wait. For
  /// replays.
  every = 1,
};

[[nodiscard]] constexpr const char* name(DeliveryMode mode) {
  return mode == DeliveryMode::every ? "every" : "latest";
}

}  // namespace stillmap
