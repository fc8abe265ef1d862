#include "clients/commands/mapping/imu_feed.hpp"

#include <cmath>
#include <cstdint>

#include "core/lidar/prepare.hpp"

namespace stillmap::cli {
namespace {

/// Delay of samples that a mapper can make up for.
constexpr std::int64_t margin_ns = 100'000'000;

}  // namespace

std::span<const ImuSample> ImuFeed::take_up_to_end_of(const Scan& scan, double period_s) {
  const SweepTimes sweep = sweep_times(scan, period_s);
  const std::int64_t end_ns =
      scan.stamp_ns + std::llround((sweep.middle_s + 0.5 * sweep.duration_s) * 1e9) + margin_ns;
  const std::size_t first = next_;
  while (next_ < samples_.size() && samples_[next_].stamp_ns <= end_ns) ++next_;
  return std::span(samples_).subspan(first, next_ - first);
}

}  // namespace stillmap::cli
