#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/recent_median.hpp"

namespace stillmap {

/// How coarsely scans are segmented, and which: every n-th. As finely as the label source and all
/// else that is done with a scan keep the sensor's rate; every n-th only where it does not at its
/// coarsest, n the smallest with which it does. It grows coarser and rarer at once, and finer and
/// more frequent with some room to spare, so that it does not swing.
class LabelCadence {
 public:
  /// LabelSource::costs().
  explicit LabelCadence(std::vector<double> costs = {1.0}) : costs_(std::move(costs)) {}

  /// A scan took so long at the present coarseness, `besides_ms` is what else is done with each,
  /// and scans come so fast (0: not known).
  void scan_segmented(double network_ms, double besides_ms, double period_ms);

  /// Never 0.
  [[nodiscard]] std::uint32_t every() const { return pace_.every; }
  /// An index of the source's costs.
  [[nodiscard]] std::size_t coarseness() const { return pace_.coarseness; }
  [[nodiscard]] double network_ms() const { return finest_ms_.value() * cost(pace_.coarseness); }
  /// Time from scan to scan as the sensor sends them.
  [[nodiscard]] double period_ms() const { return period_ms_.value(); }

 private:
  /// In the order in which they are to be preferred.
  struct Pace {
    std::size_t coarseness = 0;
    std::uint32_t every = 1;
    auto operator<=>(const Pace&) const = default;
  };

  [[nodiscard]] double cost(std::size_t coarseness) const { return costs_[coarseness]; }
  /// The first with which the network takes this share of the room that it has, or less.
  [[nodiscard]] Pace first_within(double share, double room_ms) const;

  std::vector<double> costs_;
  /// What a scan takes, or would take, at the finest.
  RecentMedian finest_ms_{5};
  RecentMedian period_ms_{9};
  Pace pace_;
};

}  // namespace stillmap
