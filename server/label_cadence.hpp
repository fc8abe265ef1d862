#pragma once

#include <cstdint>

#include "server/recent_median.hpp"

namespace stillmap {

/// Which scans are segmented: every n-th, n the smallest with which the label source and all else
/// that is done with a scan keep the sensor's rate. It grows at once and shrinks with some room to
/// spare, so that it does not swing.
class LabelCadence {
 public:
  /// A scan took so long, `besides_ms` is what else is done with each, and scans come so fast (0:
  /// not known).
  void scan_segmented(double network_ms, double besides_ms, double period_ms);

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
