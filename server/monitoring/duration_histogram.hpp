#pragma once

#include <array>
#include <cstdint>

namespace stillmap::server {

/// How often something took how long, since the start.
class DurationHistogram {
 public:
  /// Upper bounds of the buckets [s], inclusive; what is longer counts in the total alone.
  static constexpr std::array bounds_s{0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1,
                                       0.25,  0.5,    1.0,   2.5,  5.0,   10.0};

  void add(double seconds);

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double sum_s() const { return sum_s_; }
  /// How many were not longer than bounds_s[bucket].
  [[nodiscard]] std::uint64_t count_up_to(std::size_t bucket) const { return up_to_.at(bucket); }

 private:
  std::array<std::uint64_t, bounds_s.size()> up_to_{};
  std::uint64_t count_ = 0;
  double sum_s_ = 0.0;
};

}  // namespace stillmap::server
