#pragma once

#include <cstdint>
#include <optional>

namespace stillmap {

/// Times between scans, whatever their stamps do. Where stamps have come evenly, a single one that
/// does not is taken for a fault of the clock, and the time for a multiple of the sensor's period.
class ScanIntervals {
 public:
  explicit ScanIntervals(double period_s) : period_s_(period_s), mean_interval_s_(period_s) {}

  /// The first scan that is registered, and every next one.
  void begin(std::int64_t stamp_ns);
  void add(std::int64_t stamp_ns);
  /// Another lidar goes on where the last one was; what was learnt of its stamps stays.
  void set_period(double period_s) { period_s_ = period_s; }
  /// The clock was set: so much later is what it would have called the time of the last scan.
  void set_clock(std::int64_t shift_ns);

  /// Time since the last scan [s], above 0.
  [[nodiscard]] double since_last_s(std::int64_t stamp_ns) const;
  /// Between the last two scans [s], by what is known of the stamps now; 0: there was one.
  [[nodiscard]] double last_interval_s() const;
  /// The same by the stamps alone [s].
  [[nodiscard]] double stamped_since_last_s(std::int64_t stamp_ns) const;

 private:
  struct Stamp {
    std::int64_t ns = 0;
    /// As a steady clock would have set it, which follows the stamps slowly.
    std::int64_t steady_ns = 0;
  };

  [[nodiscard]] double interval_s(const Stamp& from, std::int64_t to_ns) const;

  double period_s_;
  Stamp last_;
  std::optional<Stamp> before_last_;
  /// Running mean of the stamps' deviation from multiples of the period, as a share of it.
  double irregularity_ = 0.0;
  /// Running mean of the time between stamps.
  double mean_interval_s_;
};

}  // namespace stillmap
