#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/monitoring/recent_values.hpp"

namespace stillmap::server {

/// Chooses the resolution at which scans are segmented, and which scans are: every n-th. The finest
/// resolution at which segmentation and all other work keep the sensor's rate; if even the coarsest
/// does not, the smallest n with which it does. It gets coarser or rarer at once, and finer or more
/// frequent only with some time to spare, so that it does not oscillate.
class SegmentationRateController {
 public:
  /// Segmenter::relative_costs().
  explicit SegmentationRateController(std::vector<double> costs = {1.0})
      : costs_(std::move(costs)) {}

  /// A scan took `network_ms` at the present resolution level; all other work with a scan takes
  /// `other_stages_ms`, and scans come every `period_ms` (0: unknown).
  void add_measurement(double network_ms, double other_stages_ms, double period_ms);

  /// Never 0.
  [[nodiscard]] std::uint32_t every() const { return rate_.every; }
  /// An index of the source's costs.
  [[nodiscard]] std::size_t resolution_level() const { return rate_.resolution_level; }
  /// What a scan takes at the present resolution; before the first run at it, the expected time.
  [[nodiscard]] double network_ms() const;
  /// What a scan may take to keep the sensor's rate; 0 while that is not known.
  [[nodiscard]] double room_ms() const { return room_ms_; }
  /// Time from scan to scan as the sensor sends them.
  [[nodiscard]] double period_ms() const { return period_ms_.value(); }

 private:
  static constexpr std::size_t median_window = 5;
  static constexpr int min_patience = 10;

  /// Ordered from the best.
  struct Rate {
    std::size_t resolution_level = 0;
    std::uint32_t every = 1;
    auto operator<=>(const Rate&) const = default;
  };

  /// What a scan takes at the finest resolution, or would take.
  [[nodiscard]] double finest_ms() const { return network_ms() / costs_[rate_.resolution_level]; }
  /// The best rate at which the network takes at most this share of the time that it has.
  [[nodiscard]] Rate first_within(double share, double room_ms) const;
  void change_to(Rate rate);

  std::vector<double> costs_;
  /// At the present resolution level.
  RecentMedian network_ms_{median_window};
  RecentMedian period_ms_{9};
  double room_ms_ = 0.0;
  Rate rate_;
  /// Expected time at a new resolution level, from the time at the one before.
  double expected_ms_ = 0.0;
  /// Scans segmented since the resolution level changed, and how many it takes before a finer one
  /// is tried: twice as many each time that a finer one did not last.
  int runs_ = 0;
  int patience_ = min_patience;
};

}  // namespace stillmap::server
