#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace stillmap::dds {

/// Text that somebody else sent, for terminals, logs and messages: `max_bytes` of it at most, then
/// "...". Control characters, those that turn the direction of text, and bytes that are no UTF-8,
/// become '?'.
[[nodiscard]] std::string shown_text(std::string_view text, std::size_t max_bytes);

}  // namespace stillmap::dds
