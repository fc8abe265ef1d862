#pragma once

#include <chrono>
#include <cstdint>

namespace stillmap::dds {

/// Has the kernel end TCP connections, accepted from now on by this process at `listening_port`,
/// whose peer takes no data for `timeout`. Fast DDS sends to TCP peers one after the other and
/// waits: a single peer that is stopped would hold up all others for ever.
void set_tcp_user_timeout(std::uint16_t listening_port, std::chrono::milliseconds timeout);

}  // namespace stillmap::dds
