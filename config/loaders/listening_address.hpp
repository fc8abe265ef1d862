#pragma once

#include <string>

namespace stillmap {

/// What is wrong with an address to listen on, such as 127.0.0.1:9464 or [::1]:9464, in words;
/// empty when nothing is.
[[nodiscard]] std::string listening_address_fault(const std::string& address);

}  // namespace stillmap
