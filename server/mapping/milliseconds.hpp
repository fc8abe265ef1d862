#pragma once

#include <chrono>

namespace stillmap::server {

[[nodiscard]] inline double milliseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

}  // namespace stillmap::server
