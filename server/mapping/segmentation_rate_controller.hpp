#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/monitoring/recent_median.hpp"

namespace stillmap::server {

/// How coarsely scans are segmented, and which: every n-th. As finely as the label source and all
/// else that is done with a scan keep the sensor's rate; every n-th only where it does not at its
/// coarsest, n the smallest with which it does. It grows coarser and rarer at once, and finer and
/// more frequent with some room to spare, so that it does not swing.
class SegmentationRateController {
 public:
  /// Segmenter::relative_costs().
  explicit SegmentationRateController(std::vector<double> costs = {1.0})
      : costs_(std::move(costs)) {}

  /// A scan took so long at the present resolution level, `other_stages_ms` is what else is done
  /// with each, and scans come so fast (0: not known).
  void add_measurement(double network_ms, double other_stages_ms, double period_ms);

  /// Never 0.
  [[nodiscard]] std::uint32_t every() const { return rate_.every; }
  /// An index of the source's costs.
  [[nodiscard]] std::size_t resolution_level() const { return rate_.resolution_level; }
  /// What a scan takes at the present rate; before the first run at it what it should.
  [[nodiscard]] double network_ms() const;
  /// Time from scan to scan as the sensor sends them.
  [[nodiscard]] double period_ms() const { return period_ms_.value(); }

 private:
  static constexpr std::size_t median_window = 5;
  static constexpr int min_patience = 10;

  /// In the order in which they are to be preferred.
  struct Rate {
    std::size_t resolution_level = 0;
    std::uint32_t every = 1;
    auto operator<=>(const Rate&) const = default;
  };

  /// What a scan takes at the finest, or would take.
  [[nodiscard]] double finest_ms() const { return network_ms() / costs_[rate_.resolution_level]; }
  /// The first with which the network takes this share of the room that it has, or less.
  [[nodiscard]] Rate first_within(double share, double room_ms) const;
  void change_to(Rate rate);

  std::vector<double> costs_;
  /// At the present resolution level.
  RecentMedian network_ms_{median_window};
  RecentMedian period_ms_{9};
  Rate rate_;
  /// What a scan should take at it, by what it took at the one before.
  double expected_ms_ = 0.0;
  /// Scans looked at since the resolution level changed, and how many it takes before a closer look
  /// is tried: more each time that one did not last.
  int runs_ = 0;
  int patience_ = min_patience;
};

}  // namespace stillmap::server
