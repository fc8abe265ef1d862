#pragma once

#include <string>

namespace stillmap {

/// The name of the machine that this process runs on, as the system has it now; in a container that
/// of the container. Cut off after 255 bytes.
[[nodiscard]] std::string host_name();

}  // namespace stillmap
