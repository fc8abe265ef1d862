#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap::cli {

/// Until when samples are handed out with a scan: just after its last point, where `period_s` is
/// the lidar's.
[[nodiscard]] std::int64_t end_of_samples_ns(const Scan& scan, double period_s);

/// The samples of a recorded IMU or receiver (whatever has a `stamp_ns`), handed out with the
/// scans, in the order of their stamps.
template <typename Sample>
class SampleFeed {
 public:
  explicit SampleFeed(std::vector<Sample> samples) : samples_(std::move(samples)) {
    std::ranges::stable_sort(samples_, {}, &Sample::stamp_ns);
  }

  [[nodiscard]] bool empty() const { return samples_.empty(); }
  /// Those that were not taken yet, up to just after the scan's last point; of a scan whose stamp
  /// is far ahead, no more than come with those after it.
  [[nodiscard]] std::span<const Sample> take_up_to_end_of(const Scan& scan, double period_s) {
    std::int64_t end_ns = end_of_samples_ns(scan, period_s);
    if (last_end_ns_) end_ns = std::min(end_ns, *last_end_ns_ + max_gap_ns);
    last_end_ns_ = end_ns;
    const std::size_t first = next_;
    while (next_ < samples_.size() && samples_[next_].stamp_ns <= end_ns) ++next_;
    return std::span(samples_).subspan(first, next_ - first);
  }

 private:
  /// Longer ones between scans are caught up with step by step.
  static constexpr std::int64_t max_gap_ns = 10'000'000'000;

  std::vector<Sample> samples_;
  std::size_t next_ = 0;
  std::optional<std::int64_t> last_end_ns_;
};

}  // namespace stillmap::cli
