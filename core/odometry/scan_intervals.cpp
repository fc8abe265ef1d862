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
/// Longer times between scans are as they are stamped: a gap.
constexpr double gap_periods = 10.0;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

}  // namespace

void ScanIntervals::begin(std::int64_t stamp_ns) {
  last_ = {stamp_ns, stamp_ns};
  before_last_.reset();
  mean_interval_s_ = period_s_;
}

void ScanIntervals::add(std::int64_t stamp_ns) {
  const double stamped_s = stamped_since_last_s(stamp_ns);
  const double periods = stamped_s / period_s_;
  const double deviation = std::min(1.0, std::abs(periods - std::round(periods)));
  // A gap, or a clock that was set, says nothing of the times between scans.
  if (stamped_s > 0.0 && periods <= gap_periods)
    mean_interval_s_ += mean_gain * (stamped_s - mean_interval_s_);
  const double since_steady_s = seconds(stamp_ns - last_.steady_ns);
  const double whole_s = std::max(1.0, std::round(since_steady_s / period_s_)) * period_s_;
  const double late_s = std::clamp(since_steady_s - whole_s, -period_s_, period_s_);
  irregularity_ += irregularity_gain * (deviation - irregularity_);
  before_last_ = last_;
  last_.ns = stamp_ns;
  last_.steady_ns += std::llround(1e9 * (whole_s + irregularity_gain * late_s));
}

void ScanIntervals::set_clock(std::int64_t shift_ns) {
  last_.ns += shift_ns;
  last_.steady_ns += shift_ns;
  if (!before_last_) return;
  before_last_->ns += shift_ns;
  before_last_->steady_ns += shift_ns;
}

double ScanIntervals::stamped_since_last_s(std::int64_t stamp_ns) const {
  return seconds(stamp_ns - last_.ns);
}

double ScanIntervals::since_last_s(std::int64_t stamp_ns) const {
  return interval_s(last_, stamp_ns);
}

double ScanIntervals::last_interval_s() const {
  return before_last_ ? interval_s(*before_last_, last_.ns) : 0.0;
}

double ScanIntervals::interval_s(const Stamp& from, std::int64_t to_ns) const {
  const double stamped_s = seconds(to_ns - from.ns);
  const double periods = std::round(stamped_s / period_s_);
  if (periods > gap_periods) return stamped_s;
  if (irregularity_ > max_period_deviation) {
    // Stamps that scatter about the period's own are the clock's fault, not the sensor's.
    const bool is_scatter = std::abs(mean_interval_s_ / period_s_ - 1.0) < max_mean_deviation;
    if (!is_scatter && stamped_s > 0.0) return stamped_s;
    return std::max(1.0, std::round(seconds(to_ns - from.steady_ns) / period_s_)) * period_s_;
  }
  return std::max(1.0, periods) * period_s_;
}

}  // namespace stillmap
