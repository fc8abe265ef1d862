#pragma once

#include <chrono>
#include <cstdint>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include "idl/dds/dds_options.hpp"

namespace stillmap::dds {

/// Sets what carries the participant's messages: UDP with large socket buffers or TCP, and shared
/// memory unless it is switched off.
void set_transports(const DdsOptions& options, eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Whether messages go through shared memory where they can.
[[nodiscard]] bool has_shared_memory(const eprosima::fastdds::dds::DomainParticipantQos& qos);
/// UDP or TCP alone carries the messages.
void leave_out_shared_memory(eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Receive buffer that the kernel really gives to a UDP socket asking for `wanted_bytes`
/// (net.core.rmem_max caps it). Below 4 MB, large samples get lost over UDP. Throws DdsError when
/// no socket can be made.
[[nodiscard]] std::uint32_t granted_socket_buffer_bytes(std::uint32_t wanted_bytes);

/// Has the kernel end TCP connections, accepted from now on by this process at `listening_port`,
/// whose peer takes no data for `timeout`. Fast DDS sends to TCP peers one after the other and
/// waits: a single stopped peer would block all others without end.
void set_tcp_user_timeout(std::uint16_t listening_port, std::chrono::milliseconds timeout);

}  // namespace stillmap::dds
