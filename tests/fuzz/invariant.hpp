#pragma once

#include <cstdio>
#include <cstdlib>

namespace stillmap::fuzz {

/// Ends the program where what the product promises does not hold for an input.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", what);
  std::abort();
}

}  // namespace stillmap::fuzz
