#include "core/lidar/point_time.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

constexpr double longest_offset_s = 10.0;

}  // namespace

std::vector<float> time_offsets_from_seconds(std::span<const double> times_s,
                                             std::int64_t stamp_ns) {
  double earliest = INFINITY, latest = -INFINITY;
  for (const double t : times_s) {
    if (!std::isfinite(t)) continue;
    earliest = std::min(earliest, t);
    latest = std::max(latest, t);
  }
  const double stamp_s = static_cast<double>(stamp_ns) * 1e-9;
  const auto all_near = [&](double reference) {
    return std::abs(earliest - reference) <= longest_offset_s &&
           std::abs(latest - reference) <= longest_offset_s;
  };
  const double reference = all_near(0.0) ? 0.0 : (all_near(stamp_s) ? stamp_s : earliest);

  std::vector<float> offsets;
  offsets.reserve(times_s.size());
  for (const double t : times_s) offsets.push_back(static_cast<float>(t - reference));
  return offsets;
}

}  // namespace stillmap
