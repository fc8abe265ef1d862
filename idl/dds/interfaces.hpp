#pragma once

#include <span>
#include <string>
#include <vector>

namespace stillmap::dds {

/// IPv4 addresses of this machine, of the interfaces that are up.
[[nodiscard]] std::vector<std::string> own_addresses();

/// What is wrong with the interfaces that a participant is to use, each named by its address: those
/// that are none of `own`. Fast DDS would use nothing in their place, and nobody would hear the
/// process. Empty where all are there.
[[nodiscard]] std::string unknown_interfaces(std::span<const std::string> interfaces,
                                             std::span<const std::string> own);

}  // namespace stillmap::dds
