#include "core/odometry/scan_intervals.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Weight of the newest stamp in the running mean of their deviations, and of the newest interval
/// in theirs, which is to be told to some percent however the stamps scatter.
constexpr double irregularity_gain = 0.1;
constexpr double mean_gain = 0.02;
/// A stamp off the sensor's period by more than this share of it is irregular.
constexpr double max_period_deviation = 0.1;
/// Irregular stamps whose mean interval is the period within this share only scatter.
constexpr double max_mean_deviation = 0.05;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

}  // namespace

void ScanIntervals::begin(std::int64_t stamp_ns) {
  last_ns_ = stamp_ns;
  steady_ns_ = stamp_ns;
  mean_interval_s_ = period_s_;
}

void ScanIntervals::add(std::int64_t stamp_ns) {
  const double stamped_s = stamped_since_last_s(stamp_ns);
  const double periods = stamped_s / period_s_;
  const double deviation = std::min(1.0, std::abs(periods - std::round(periods)));
  mean_interval_s_ += mean_gain * (stamped_s - mean_interval_s_);
  const double since_steady_s = seconds(stamp_ns - steady_ns_);
  const double whole_s = std::max(1.0, std::round(since_steady_s / period_s_)) * period_s_;
  const double late_s = std::clamp(since_steady_s - whole_s, -period_s_, period_s_);
  steady_ns_ += std::llround(1e9 * (whole_s + irregularity_gain * late_s));
  irregularity_ += irregularity_gain * (deviation - irregularity_);
  last_ns_ = stamp_ns;
}

double ScanIntervals::stamped_since_last_s(std::int64_t stamp_ns) const {
  return seconds(stamp_ns - last_ns_);
}

double ScanIntervals::since_last_s(std::int64_t stamp_ns) const {
  const double interval_s = stamped_since_last_s(stamp_ns);
  const double periods = std::round(interval_s / period_s_);
  if (periods > 10.0) return interval_s;
  if (irregularity_ > max_period_deviation) {
    // Stamps that scatter about the period's own are the clock's fault, not the sensor's.
    const bool is_scatter = std::abs(mean_interval_s_ / period_s_ - 1.0) < max_mean_deviation;
    if (!is_scatter) return interval_s;
    return std::max(1.0, std::round(seconds(stamp_ns - steady_ns_) / period_s_)) * period_s_;
  }
  return std::max(1.0, periods) * period_s_;
}

}  // namespace stillmap
