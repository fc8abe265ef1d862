#pragma once

#include <pthread.h>

#include <algorithm>
#include <array>
#include <string>

namespace stillmap::server {

/// The name of a thread in `top -H`, perf, gdb and the log. Linux keeps its first 15 characters.
inline void name_this_thread(std::string name) {
  constexpr std::size_t max_length = 15;
  name.resize(std::min(name.size(), max_length));
  pthread_setname_np(pthread_self(), name.c_str());
}

[[nodiscard]] inline std::string name_of_this_thread() {
  std::array<char, 16> name{};
  pthread_getname_np(pthread_self(), name.data(), name.size());
  return name.data();
}

}  // namespace stillmap::server
