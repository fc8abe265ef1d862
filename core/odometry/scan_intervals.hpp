#pragma once

#include <cstdint>

namespace stillmap {

/// Times between scans, whatever their stamps do. Where stamps have come evenly, a single one that
/// does not is taken for a fault of the clock, and the time for a multiple of the sensor's period.
class ScanIntervals {
 public:
  explicit ScanIntervals(double period_s) : period_s_(period_s), mean_interval_s_(period_s) {}

  /// The first scan that is registered, and every next one.
  void begin(std::int64_t stamp_ns);
  void add(std::int64_t stamp_ns);

  /// Time since the last scan [s].
  [[nodiscard]] double since_last_s(std::int64_t stamp_ns) const;
  /// The same by the stamps alone [s].
  [[nodiscard]] double stamped_since_last_s(std::int64_t stamp_ns) const;

 private:
  double period_s_;
  std::int64_t last_ns_ = 0;
  /// Running mean of the stamps' deviation from multiples of the period, as a share of it.
  double irregularity_ = 0.0;
  /// Running mean of the time between stamps.
  double mean_interval_s_;
  /// The last stamp as a steady clock would have set it, which follows the stamps slowly.
  std::int64_t steady_ns_ = 0;
};

}  // namespace stillmap
