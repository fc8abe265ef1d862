#pragma once

#include <cstdint>

namespace stillmap {

/// A random id, never 0: tells two maps apart, wherever and whenever they were begun.
[[nodiscard]] std::uint64_t new_map_id();

}  // namespace stillmap
