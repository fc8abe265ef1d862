#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace stillmap::simulation {

/// Random numbers that depend on their keys only, so that scans can be made in any order and on any
/// thread.
class Random {
 public:
  explicit constexpr Random(std::uint64_t seed, std::uint64_t a = 0, std::uint64_t b = 0,
                            std::uint64_t c = 0)
      : state_(mix(mix(mix(mix(seed + 1) ^ (a + 1)) ^ (b + 1)) ^ (c + 1))) {}

  /// 0 <= x < 1.
  constexpr double uniform() {
    state_ += 0x9E3779B97F4A7C15ULL;
    return static_cast<double>(mix(state_) >> 11U) * 0x1p-53;
  }
  constexpr double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// As `uniform`, in single precision.
  constexpr float between(double low, double high) {
    return static_cast<float>(uniform(low, high));
  }
  constexpr bool chance(double probability) { return uniform() < probability; }
  /// 0 .. count - 1.
  constexpr std::size_t index(std::size_t count) {
    return static_cast<std::size_t>(uniform() * static_cast<double>(count));
  }
  /// An independent generator, seeded from this one.
  constexpr Random fork() { return Random(index(1U << 30U)); }
  /// Standard normal (Box-Muller).
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

 private:
  // Finaliser of SplitMix64 (Steele, Lea and Flood, 2014).
  static constexpr std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
    return x ^ (x >> 31U);
  }
  std::uint64_t state_;
};

}  // namespace stillmap::simulation
