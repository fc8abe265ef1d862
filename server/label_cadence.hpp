#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace stillmap {

/// Median of the last few values, which single outliers do not move.
class RecentMedian {
 public:
  explicit RecentMedian(std::size_t window) : window_(window) {}
  void add(double value);
  /// 0 before the first value.
  [[nodiscard]] double value() const;

 private:
  std::size_t window_;
  std::deque<double> last_;
};

/// Which scans are segmented: every n-th, n the smallest that the label source can keep. It grows
/// at once and shrinks with some room to spare, so that it does not swing.
class LabelCadence {
 public:
  /// A scan took so long while scans came so fast; 0: not known.
  void scan_segmented(double network_ms, double period_ms);

  /// Never 0.
  [[nodiscard]] std::uint32_t every() const { return every_; }
  [[nodiscard]] double network_ms() const { return network_ms_.value(); }
  /// Time from scan to scan as the sensor sends them.
  [[nodiscard]] double period_ms() const { return period_ms_.value(); }

 private:
  RecentMedian network_ms_{5};
  RecentMedian period_ms_{9};
  std::uint32_t every_ = 1;
};

}  // namespace stillmap
