#pragma once

#include <string>
#include <string_view>

namespace stillmap::server {

/// A name that somebody else gave, for logs and the status: 100 bytes of it at most, then "...".
/// Control characters, and bytes that are no UTF-8, become '?'.
[[nodiscard]] std::string shown_name(std::string_view name);

}  // namespace stillmap::server
