#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "tests/slowdown.hpp"

namespace stillmap::test {

/// The longest that a loaded machine may need for anything in the tests.
inline constexpr std::chrono::seconds patience{60 * slowdown};

/// Waits until `condition` holds, looking every `poll_period`; false after `timeout`. For what
/// other threads and processes do: a span that is slept through is too short on a loaded machine
/// and wasted on an idle one.
[[nodiscard]] inline bool eventually(
    const std::function<bool()>& condition, std::chrono::milliseconds timeout = patience,
    std::chrono::milliseconds poll_period = std::chrono::milliseconds(10)) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(poll_period);
  }
  return true;
}

}  // namespace stillmap::test
