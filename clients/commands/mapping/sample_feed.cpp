#include "clients/commands/mapping/sample_feed.hpp"

#include <cmath>

#include "core/lidar/prepare.hpp"

namespace stillmap::cli {
namespace {

/// More than the delay of samples that a mapper can make up for.
constexpr std::int64_t margin_ns = 200'000'000;

}  // namespace

std::int64_t end_of_samples_ns(const Scan& scan, double period_s) {
  const SweepTimes sweep = sweep_times(scan, period_s);
  return scan.stamp_ns + std::llround((sweep.middle_s + 0.5 * sweep.duration_s) * 1e9) + margin_ns;
}

}  // namespace stillmap::cli
