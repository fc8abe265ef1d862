#pragma once

namespace stillmap::test {

/// How many times as long the tests' time limits are, and the periods of those that act in real
/// time. Sanitizers make code on Eigen about ten times as slow.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int slowdown = 5;
#else
inline constexpr int slowdown = 1;
#endif

}  // namespace stillmap::test
