#pragma once

#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "idl/dds/dds_options.hpp"

namespace stillmap {

/// UDP with large socket buffers, and shared memory unless it is switched off.
[[nodiscard]] std::vector<std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>>
make_transports(const DdsOptions& options);

/// Receive buffer that the kernel really gives to a UDP socket asking for `wanted_bytes`
/// (net.core.rmem_max caps it). Below 4 MB, large samples get lost over UDP. Throws DdsError when
/// no socket can be made.
[[nodiscard]] std::uint32_t granted_socket_buffer_bytes(std::uint32_t wanted_bytes);

}  // namespace stillmap
