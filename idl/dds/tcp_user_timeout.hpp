#pragma once

#include <chrono>
#include <cstdint>

namespace stillmap {

/// Has the kernel end TCP connections, accepted from now on by this process at `listening_port`,
/// whose peer takes no data for `patience`. Fast DDS sends to TCP peers one after the other and
/// waits: a single peer that is stopped would hold up all others for ever.
void drop_stalled_peers(std::uint16_t listening_port, std::chrono::milliseconds patience);

}  // namespace stillmap
